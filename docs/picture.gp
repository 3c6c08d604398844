# The picture of the README: the same piece of the quickstart's tile as observed and as two restorers give it back.
#
#   gnuplot -c docs/picture.gp FOLDER      FOLDER/restored_{NONE,RL,NET}.fits -> FOLDER/picture.png
#
# One grey scale, asinh((pixel - sky) / 15 ADU); the noise of the sky is 9 ADU. The image's pixels end each file: 512 x 512
# floats, filled up to a multiple of 2880 bytes.
set terminal png size 1010,360 medium
set output ARG1."/picture.png"
set multiplot
unset key; unset colorbox; unset tics; unset border
set palette gray negative
set cbrange [-0.8:4.5]
set bmargin screen 0; set tmargin screen 330. / 360
set title offset 0,-0.5
array titles[3] = ["as observed, FWHM 4 pixels", "Richardson-Lucy", "network PSF-NET"]
do for [i = 1:3] {
    file = ARG1."/restored_".word("NONE RL NET", i).".fits"
    header = int(system("wc -c <'".file."'")) - 365 * 2880
    set lmargin screen (i - 1) * 340. / 1010
    set rmargin screen ((i - 1) * 340. + 330) / 1010
    set title titles[i]
    plot [15:180] [250:415] file binary array=(512,512) format="%float32" endian=big skip=header \
        using (asinh(($1 - 150) / 15)) with image pixels
}
