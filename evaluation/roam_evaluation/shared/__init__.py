"""What several studies use: records, pictures."""
