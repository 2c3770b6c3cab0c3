"""Room for the words around panels that stand one below the other; import it only to draw."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import LayoutEngine

PAD = 0.06
"""Free paper at each edge and between what stands next to each other [in]."""

LETTER = 0.12
"""Room below a panel that has others below it, for half of a number and a mark [in]."""

BELOW = 0.5
"""Height of the numbers and the label of the time axis [in]."""

BESIDE = 0.2
"""Room right of a panel, for half of the last number of its time axis [in]."""

TITLE = 0.2
"""Height of a panel's title with what parts it from the panel [in]."""


class Fitted(LayoutEngine):
    """Makes room for a legend above, titles, a time axis below, and the words of the y axes.

    Matplotlib's constrained layout measures all words four times, and takes longer than drawing
    them. Of these figures all sizes are known but those of the y axes and the legend.
    """

    _adjust_compatible = True
    _colorbar_gridspec = True

    def execute(self, fig: Figure) -> None:
        """Place the panels; it is called before a figure is drawn."""
        panels = fig.axes
        top = PAD + sum(_inches(fig, legend.get_window_extent().height) for legend in fig.legends)
        titles = [TITLE if ax.get_title("left") else 0.0 for ax in panels]
        above = [PAD + title for title in titles]
        _place(fig, 0.6, top, above)

        # What the y axes need is known only once they are about as high as they will be.
        boxes = [ax.yaxis.get_tightbbox() for ax in panels]
        left = 0.0
        for k, (ax, box) in enumerate(zip(panels, boxes, strict=True)):
            if box is not None:
                left = max(left, _inches(fig, ax.bbox.x0 - box.x0))
                # A common factor of the numbers stands above them, and the title above that.
                above[k] = max(PAD, _inches(fig, box.y1 - ax.bbox.y1)) + titles[k]
        _place(fig, left, top, above)


def _inches(figure: Figure, pixels: float) -> float:
    """Return a length on a figure [in]."""
    return pixels / figure.dpi


def _place(figure: Figure, left: float, top: float, above: list[float]) -> None:
    """Place panels in a column.

    Args:
        figure: The figure.
        left: Room for the words of the y axes [in].
        top: Room above all panels [in].
        above: Room above each of them [in]; the largest one is between any two.
    """
    panels: list[Axes] = figure.axes
    width, height = figure.get_size_inches().tolist()
    upper = height - top - above[0]
    gap = max(above[1:], default=0.0) + LETTER
    each = max((upper - BELOW - gap * (len(panels) - 1)) / len(panels), PAD)

    figure.subplots_adjust(
        left=(left + PAD) / width,
        right=1.0 - BESIDE / width,
        bottom=BELOW / height,
        top=upper / height,
        hspace=gap / each,
    )
