"""From photographs to posed images, depth maps and clouds."""
