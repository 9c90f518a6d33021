G21         ; Set units to mm
G90         ; Absolute positioning
G1 Z2.54 F2540      ; Move to clearance level

;
; Operation:    0
; Name:
; Type:         Pocket
; Paths:        1
; Direction:    Conventional
; Cut Depth:    3.175

; Path 0
; Rapid to initial position
G1 X1.0000 Y1.0000 F2540
G1 Z0.0000
; plunge
G1 Z-1.0000 F254
; cut
G1 X5.0000 Y1.0000 F1016
; Retract
G1 Z2.54 F2540
M2
