%
(Rectangular pocket of 80 x 50 x 6 mm with a tool of 10 mm diameter: helix into the material, then)
(rings with rounded corners from the inside outwards, in three levels. Own dimensions.)
(Subroutines and loops as post-processors and conversational controls write them.)
G21 G17 G90 G94 G40 G49 G80 G54
T1 M6
G43 H1
S6000 M3
M8

#<length>=80 #<width>=50 #<depth>=6
#<radius>=5     (of the tool)
#<level>=2      (depth of a level)
#<stepover>=4
#<corner>=3     (of the tool center path)
#<_feed cut>=1800
#<_feed plunge>=600

(Ring with half length #1, half width #2, and corner radius #3, at the present depth)
o<ring> sub
  G1 X0 Y-#2 F#<_feed cut>
  X[#1-#3]
  G3 X#1 Y[#3-#2] J#3
  G1 Y[#2-#3]
  G3 X[#1-#3] Y#2 I-#3
  G1 X[#3-#1]
  G3 X-#1 Y[#2-#3] J-#3
  G1 Y[#3-#2]
  G3 X[#3-#1] Y-#2 I#3
  G1 X0
o<ring> endsub

G64 P0.02
G0 X2 Y0 Z10
G0 Z1
#<z>=0
o<levels> while [#<z> GT -#<depth>]
  #<z>=[#<z>-#<level>]
  G1 X2 Y0 F#<_feed cut>
  G3 I-2 Z#<z> P3 F#<_feed plunge>  (helix: three turns)
  G3 I-2 F#<_feed cut>
  #<half>=#<stepover>
  o<rings> while [#<half> LE [#<width>/2-#<radius>]]
    o<ring> call [#<half>+[#<length>-#<width>]/2] [#<half>] [#<corner>]
    #<half>=[#<half>+#<stepover>]
  o<rings> endwhile
  G1 Y[-#<width>/2+#<radius>+2]  (off the wall)
  G0 Z[#<z>+1]
  G0 X2 Y0
o<levels> endwhile

G0 Z10
M9
M5
G49
G53 G0 Z0
M30
%
