"""Objects and cases that goal poses are measured on."""
