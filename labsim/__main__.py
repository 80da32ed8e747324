"""``python -m labsim`` is ``labsim``."""

from labsim.cli import main

if __name__ == "__main__":
    main()
