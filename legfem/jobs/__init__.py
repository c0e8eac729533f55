"""Long work: a pool of processes, finished work that is kept, states of a solution in hand."""
