"""Entry point: `python3 -m drivers`."""

import sys

from uplift.drivers.cli import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
