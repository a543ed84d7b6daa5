"""What panels show as HTML or SVG."""
