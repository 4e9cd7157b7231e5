"""Files as they are, before anybody knows what character they hold: glTF documents and BVH clips."""
