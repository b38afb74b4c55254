"""Write the records of all cases, or of those named: `python tests/calibration/golden/make.py [NAME ...]`."""

import json
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from cases import FITS, HERE, OTHERS, golden  # pyright: ignore[reportMissingImports]

from jshell import programs
from jshell.io.records import plain


def main(names: list[str]) -> None:
    """Write them, and on which kind of processor they were found."""
    (HERE / "processor.txt").write_text(programs.processor() + "\n", encoding="utf-8")
    for name in names or (*FITS, *OTHERS):
        begun = time.perf_counter()
        content = json.dumps(plain(golden(name)), ensure_ascii=False, indent=1)
        (HERE / "records" / f"{name}.json").write_text(content + "\n", encoding="utf-8")
        print(f"{name}: {time.perf_counter() - begun:.1f} s", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
