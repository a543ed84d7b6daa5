"""Feasibility maps: computing, explaining and drawing them."""
