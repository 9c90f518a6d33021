(error unknown_word 2:5; error unknown_word 3:1; error unknown_word 4:1)
G41 D1
G41.1 P5
M100
M30
