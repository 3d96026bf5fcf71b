# gnuplot bands.gp draws bands.svg and bands.pdf from bands.csv
set datafile separator ","
set datafile missing NaN
set encoding utf8
set key noautotitle samplen 1.5 font ",9"
set grid lc rgb "#dddddd"
set tics font ",9"
set pointintervalbox 0.01
set errorbars 0.3
data = "bands.csv"
do for [terminal_name in "svg pdf"] {
if (terminal_name eq "svg") { set terminal svg noenhanced size 700,480 background "white" font "sans,11"
} else { set terminal pdfcairo noenhanced size 7.00in,4.80in font "sans,8" }
set output "bands.".terminal_name
set multiplot layout 1,1
set logscale xy
set xlabel "bands"
set ylabel "cold fit / us"
set key top left
plot data index 0 using 3:4 with linespoints pt 7 ps 0.5 title "variable projection (goniod model)"
unset logscale
unset multiplot
unset output
}
