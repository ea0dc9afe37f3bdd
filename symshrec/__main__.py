"""`python -m symshrec COMMAND …`: the command line without its script."""

import sys

from symshrec.cli import main

if __name__ == "__main__":
    sys.exit(main())
