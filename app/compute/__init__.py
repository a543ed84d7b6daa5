"""Computing for the page: the shared cache, the process of each session, and its queue of jobs."""
