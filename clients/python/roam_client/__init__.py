"""Client of ROAM Services: goal poses and streamed motion, without torch."""
