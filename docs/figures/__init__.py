"""The pictures of the README and the gallery, made from the shipped scenes: ``make figures``."""
