"""What an answer says about itself."""
