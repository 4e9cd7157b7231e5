"""`python -m roam_command` is `roam`."""

from roam_command.main import main

main()
