"""Whether bars of fibrous tissue tell its stiffness and how much stiffer it is along its fibres."""
