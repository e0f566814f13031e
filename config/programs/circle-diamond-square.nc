%
(Outlines of a contouring test piece in the manner of ISO 10791-7: circle, diamond, square, and a)
(square turned by 3 degrees, whose sides move one axis slowly. Dimensions and feed are chosen here.)
(Paths of the tool center, in mm; the zero point is the center of the piece, on its upper face.)
N10 G21 G17 G90 G94 G40 G49 G80 G54
N20 T1 M6
N30 G43 H1
N40 S8000 M3 M8
N50 G64 P0.01 (path tolerance)
N60 G0 X70 Y0 Z20

(Circle of diameter 108, tangential approach and departure with radius 16)
N100 G0 X70 Y-16 Z2
N110 G1 Z-5 F1000
N120 G2 X54 Y0 I0 J16 F3000
N130 G3 I-54 J0
N140 G2 X70 Y16 I16 J0
N150 G0 Z2

(Diamond: square with a side of 108, turned by 45 degrees)
N200 G0 X76.3675 Y-20
N210 G1 Z-10 F1000
N220 G1 X76.3675 Y0 F3000
N230 X0 Y76.3675
N240 X-76.3675 Y0
N250 X0 Y-76.3675
N260 X76.3675 Y0
N270 X76.3675 Y20
N280 G0 Z2

(Square with a side of 160)
N300 G0 X80 Y-100
N310 G1 Z-15 F1000
N320 G1 X80 Y80 F3000
N330 X-80
N340 Y-80
N350 X80
N360 X100
N370 G0 Z2

(Square with a side of 170, turned by 3 degrees: the slow axis reverses at each corner)
N400 #<side>=170 #<slope>=3
N410 #<cos>=[COS[#<slope>]*#<side>/2] #<sin>=[SIN[#<slope>]*#<side>/2]
N420 G0 X[#<cos>+#<sin>+20] Y[#<sin>-#<cos>]
N430 G1 Z-20 F1000
N440 G1 X[#<cos>+#<sin>] Y[#<sin>-#<cos>] F3000
N450 X[#<cos>-#<sin>] Y[#<sin>+#<cos>]
N460 X[-#<cos>-#<sin>] Y[#<cos>-#<sin>]
N470 X[#<sin>-#<cos>] Y[-#<sin>-#<cos>]
N480 X[#<cos>+#<sin>] Y[#<sin>-#<cos>]
N490 G0 Z20

N500 M9
N510 M5
N520 G49
N530 G53 G0 Z0
N540 M30
%
