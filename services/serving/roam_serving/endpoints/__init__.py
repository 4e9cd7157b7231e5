"""Services that every server offers besides its own."""
