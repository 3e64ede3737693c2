"""`python -m dslam_mav` is `dslam-mav`."""

import sys

from dslam_mav.cli import main

if __name__ == "__main__":
    sys.exit(main())
