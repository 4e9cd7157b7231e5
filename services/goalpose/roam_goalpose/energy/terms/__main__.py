"""`python -m roam_goalpose.energy.terms`: the table of energy terms, as docs/concepts/goal-poses.md has it."""

from roam_goalpose.energy.terms import table

print(table(), end="")
