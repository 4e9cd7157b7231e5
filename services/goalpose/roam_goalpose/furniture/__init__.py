"""Procedural furniture: unions of parametric solids with exact occupancy, and where one sits on them.

solids.py sheets.py     the bricks
legs.py seats.py backs.py   the parts
chair.py sofa.py …      one file per kind
catalog.py              the table of kinds: add yours there
"""

from roam_goalpose.furniture.catalog import CATEGORIES, TABLE, WITHIN, Category, generate
from roam_goalpose.furniture.piece import Furniture

__all__ = ["CATEGORIES", "TABLE", "WITHIN", "Category", "Furniture", "generate"]
