"""Reading trajectories and paths: files in long form, NURBS, orders of VDA 5050."""
