# gnuplot points.gp draws points.svg and points.pdf from points.csv
set datafile separator ","
set datafile missing NaN
set encoding utf8
set key noautotitle samplen 1.5 font ",9"
set grid lc rgb "#dddddd"
set tics font ",9"
set pointintervalbox 0.01
set errorbars 0.3
data = "points.csv"
do for [terminal_name in "svg pdf"] {
if (terminal_name eq "svg") { set terminal svg noenhanced size 700,480 background "white" font "sans,11"
} else { set terminal pdfcairo noenhanced size 7.00in,4.80in font "sans,8" }
set output "points.".terminal_name
set multiplot layout 1,1
set logscale xy
set xlabel "points"
set ylabel "cold fit / us"
set key top left
plot data index 0 using 3:4 with linespoints pt 7 ps 0.5 title "TinySolver (goniod model)", data index 1 using 3:4 with linespoints pt 7 ps 0.5 title "Solver dense QR (goniod model)", data index 2 using 3:4 with linespoints pt 7 ps 0.5 title "Solver normal Cholesky (goniod model)", data index 3 using 3:4 with linespoints pt 7 ps 0.5 title "MINPACK lmder (goniod model)", data index 4 using 3:4 with linespoints pt 7 ps 0.5 title "MINPACK lmder (plain model)", data index 5 using 3:4 with linespoints pt 7 ps 0.5 title "GSL multifit (goniod model)", data index 6 using 3:4 with linespoints pt 7 ps 0.5 title "GSL multifit (plain model)", data index 7 using 3:4 with linespoints pt 7 ps 0.5 title "scipy lm (numpy model)", data index 8 using 3:4 with linespoints pt 7 ps 0.5 title "scipy trf (numpy model)"
unset logscale
unset multiplot
unset output
}
