(error modal_conflict 2:8)
G41 G4 P5
M30
