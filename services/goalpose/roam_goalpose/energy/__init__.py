"""The energy that a goal pose minimises: one file per term (paper section 3.1.3 and beyond)."""
