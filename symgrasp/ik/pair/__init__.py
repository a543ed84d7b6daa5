"""Arms of which the axes of the last two joints meet: geometry, polynomial and solver."""
