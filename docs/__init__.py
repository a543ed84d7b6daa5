"""What the documentation is made with: its pictures, its table of times, and what runs its pages."""
