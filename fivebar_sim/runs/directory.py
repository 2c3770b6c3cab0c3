"""Writes run directories, whole or not at all.

They hold scenario.toml, metrics.json, rollout.parquet and recording.rrd.
"""

from __future__ import annotations

import errno
import json
import shlex
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import tomli_w

from fivebar_sim.arrays import Array
from fivebar_sim.errors import RunDirectoryError
from fivebar_sim.files import exchange, leftovers, quantities, whole_file
from fivebar_sim.metrics.columns import digest
from fivebar_sim.runs import checksums, described, recorded
from fivebar_sim.runs.anew import beside
from fivebar_sim.runs.kept import DIVERGED, FILES, keep, own_names
from fivebar_sim.scenario.run import Run
from fivebar_sim.simulation.provenance import identity

RECORDING = "recording.rrd"
SCENARIO = "scenario.toml"

TABLES = ("leg", "path", "force", "scene", "servo", "controller", "sensors", "sim")
"""Tables of a scenario whose keys have units; each is an attribute of it."""

GROUP = 100_000
"""Rows of a record that are encoded at once: 20 MB."""

ATTEMPTS = 20
"""How often the exchange is tried while other processes write to the same place."""

OVERTAKEN = {errno.ENOENT, errno.ENOTEMPTY, errno.EEXIST}
"""Errors of a rename when another process renamed something there in between."""


def write(result: Run, path: Path) -> Path:
    """Write a run directory beside its place, then rename it, so that it is never incomplete.

    An existing run directory, or an empty one, is replaced; anything else there is refused. What a
    user has put beside the run's own files stays; a report of the old run goes with it.

    Raises:
        RunDirectoryError: The place is taken by something else, or cannot be written.
    """
    check_place(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=".partial", dir=path.parent))
    except OSError as error:
        raise RunDirectoryError(f"cannot write {path}: {error.strerror}") from None

    try:
        with leftovers.held(stage):
            _fill(stage, result)
            # mkdtemp makes directories that only their owner can enter.
            stage.chmod(0o755)
            exchange.flush(stage)
            _exchange(stage, path)
    except OSError as error:
        raise RunDirectoryError(f"cannot write {path}: {error.strerror or error}") from None
    finally:
        # After an exchange this is the old run.
        _delete(stage)

    leftovers.sweep(path)
    return path


def discard(path: Path, why: str) -> None:
    """Delete the run at path, if any: a new one there diverged, and the old one is no evidence.

    What a user has put beside its files stays, and `DIVERGED` then says why the run is gone.

    Raises:
        RunDirectoryError: It cannot be deleted.
    """
    try:
        if not _is_ours(path):
            return
        own = own_names(path) - {DIVERGED}
        # First, so that the place is known as a run's whenever this is interrupted.
        (path / DIVERGED).write_text(f"{why}\n", encoding="utf-8", errors="backslashreplace")
        for name in own:
            (path / name).unlink(missing_ok=True)

        # A link to a directory stays a link to one.
        alone = [entry.name for entry in path.iterdir()] == [DIVERGED]
        if alone and not path.is_symlink():
            (path / DIVERGED).unlink()
            path.rmdir()
    except OSError as error:
        raise RunDirectoryError(f"cannot delete {path}: {error.strerror or error}") from None


def check_place(path: Path) -> None:
    """Raise unless a run directory may be written at path.

    Raises:
        RunDirectoryError: A file or a directory of something else is there, or no directory can
            be made there.
    """
    try:
        # No system renames the folder that a process works in.
        taken = _is_taken(path) or path.resolve() == Path.cwd()
    except OSError as error:
        raise RunDirectoryError(f"cannot write {path}: {error.strerror}") from None

    if taken:
        raise RunDirectoryError(
            f"cannot write {path}: something that is not a run directory is there"
        )
    whole_file.check_parent(path, RunDirectoryError)


def _is_taken(path: Path) -> bool:
    """Return whether something is at path that is neither a run directory nor empty.

    Another process may exchange what is there during the look, which is then repeated.
    """
    for left in reversed(range(ATTEMPTS)):
        before = _identity(path)
        try:
            ours = path.is_dir() and (_is_ours(path) or not any(path.iterdir()))
        except FileNotFoundError:
            continue
        taken = not ours and before is not None
        if not taken or not left or _identity(path) == before:
            return taken
    return False


def _identity(path: Path) -> tuple[int, int] | None:
    """Return which file or folder is at path; None if nothing is."""
    try:
        found = path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    return found.st_dev, found.st_ino


def _is_ours(path: Path) -> bool:
    """Return whether a run was written at path; its recording can be rebuilt and may be gone."""
    whole = all((path / name).is_file() for name in FILES if name != RECORDING)
    return whole or (path / DIVERGED).is_file()


def is_run(path: Path) -> bool:
    """Return whether path is a complete run directory."""
    return all((path / name).is_file() for name in FILES)


def check_run(path: Path) -> None:
    """Raise unless path is a complete run directory.

    Raises:
        RunDirectoryError: Naming what is missing.
    """
    missing = [name for name in FILES if not (path / name).is_file()]
    if missing:
        what = f"it lacks {', '.join(missing)}" if path.is_dir() else "no such directory"
        if path.is_dir() and SCENARIO not in missing:
            again = shlex.join(["fivebar", "run", str(path / SCENARIO), "--out"])
            what += f"; `{again} DIR` makes it again, in another place"
        raise RunDirectoryError(f"{path} is not a run directory: {what}")


def as_toml(scenario: Any) -> str:
    """Return a resolved scenario as TOML, with the units of its keys as comments."""
    parts = {name: getattr(scenario, name, None) for name in TABLES}
    kinds = {name: type(part) for name, part in parts.items() if part is not None}
    return quantities.annotated(tomli_w.dumps(scenario.table()), kinds, {"duration": "s"})


def _fill(stage: Path, result: Run) -> None:
    """Write the files of a run into an empty directory."""
    scenario = result.scenario
    (stage / "scenario.toml").write_text(as_toml(scenario), encoding="utf-8")
    for name, content in scenario.files.items():
        (stage / name).write_bytes(content)
    text = json.dumps(result.measured.table, indent=2, allow_nan=False)
    (stage / "metrics.json").write_text(text + "\n", encoding="utf-8")
    # Last of these: it has the checksums of the others.
    others = ["scenario.toml", "metrics.json", *scenario.files]
    checksum = write_record(stage, result.record, others, beside.written(result.measured))
    # A checksum takes as long as the rest of the record's file: it is computed once.
    recorded.write(stage / RECORDING, [result], identities=[identity(result, checksum)])


def write_record(
    folder: Path,
    record: Mapping[str, Array],
    others: Iterable[str],
    more: Mapping[bytes, bytes] | None = None,
) -> str:
    """Write the record as Parquet, one column each, with units, and checksums that show damage.

    Byte by byte, as all signs and exponents are alike: a third of the size, in a third of the time.
    Returns the record's own checksum.

    Args:
        folder: The run directory.
        record: The columns.
        others: Names of the run's other files, which are there: their checksums go with it.
        more: Further metadata.
    """
    import pyarrow
    import pyarrow.parquet

    checksum = digest(record)
    sums = checksums.of_files(folder, others) | {checksums.RECORD: checksum}
    said = described.metadata(record)
    fields = [pyarrow.field(name, pyarrow.float64(), metadata=said.get(name)) for name in record]
    schema = pyarrow.schema(fields, metadata={**checksums.written(sums), **(more or {})})
    table = pyarrow.table(dict(record), schema=schema)
    # Given a name instead of a file, pyarrow would expand ~ and read it as a URI.
    with (folder / checksums.RECORD).open("wb") as file:
        pyarrow.parquet.write_table(
            table,
            file,
            row_group_size=GROUP,
            compression="zstd",
            use_dictionary=False,
            use_byte_stream_split=True,
            write_page_checksum=True,
        )
    return checksum


def _exchange(stage: Path, path: Path) -> None:
    """Rename stage to path, even while other processes write there: the last one wins."""
    for left in reversed(range(ATTEMPTS)):
        try:
            keep(path, stage)
            return _renamed(stage, path)
        except OSError as error:
            if not left or error.errno not in OVERTAKEN:
                raise


def _renamed(stage: Path, path: Path) -> None:
    """Rename stage to path, in exchange for what is there."""
    if not path.exists():
        stage.rename(path)
        return
    if exchange.exchange(stage, path):
        return

    # Elsewhere in two steps: what is killed between them leaves the old run in its folder aside.
    aside = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=".old", dir=path.parent))
    old = aside / path.name
    try:
        path.rename(old)
        try:
            stage.rename(path)
        except BaseException:
            # An interrupt too must not lose the run that was there.
            if not path.exists():
                old.rename(path)
            raise
    finally:
        _delete(aside)


def _delete(folder: Path) -> None:
    """Delete a directory, even if a signal comes meanwhile; of a link to one, the link."""
    if folder.is_symlink():
        folder.unlink()
        return
    try:
        shutil.rmtree(folder, ignore_errors=True)
    except BaseException:
        # No signal interrupts the clean-up after another one.
        shutil.rmtree(folder, ignore_errors=True)
        raise
