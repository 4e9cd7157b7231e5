"""Readers of file formats, behind one registry."""

from roam_goalpose.objects.readers.registry import FORMATS, Format, Read, format_of, media_types, register, sniff

__all__ = ["FORMATS", "Format", "Read", "format_of", "media_types", "register", "sniff"]
