"""A process that takes control of a device and executes the full motion, until the suite kills it.

`python -m arcor2_hw.testing.first_day.orphan cell.yaml NAME STATE`; STATE are `asked` and `starts` of the bench.
"""

import sys
from pathlib import Path

import msgspec

from arcor2_hw.data.cell import read_cell
from arcor2_hw.testing.first_day.bench import real_bench


def main() -> None:
    """Execute the full motion once."""
    file, name, state = Path(sys.argv[1]), sys.argv[2], sys.argv[3]
    entry = read_cell(file).device(name)
    assert entry is not None
    bench = real_bench(entry, file)()
    bench.asked, bench.starts = msgspec.json.decode(state)
    bench.run_long(bench.controlled())


if __name__ == "__main__":
    main()
