"""Stands in for pandas in programs that tests start, and is not there.

pyarrow imports pandas, where that is installed, to ask whether an array is one of its Series: half
a second of processor time in each program that writes a run, for an answer that is always no.
"""

raise ImportError("the programs that these tests start do without pandas")
