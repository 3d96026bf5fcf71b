# gnuplot convergence_1.gp draws convergence_1.svg and convergence_1.pdf from convergence_1.csv
set datafile separator ","
set datafile missing NaN
set encoding utf8
set key noautotitle samplen 1.5 font ",9"
set grid lc rgb "#dddddd"
set tics font ",9"
set pointintervalbox 0.01
set errorbars 0.3
data = "convergence_1.csv"
do for [terminal_name in "svg pdf"] {
if (terminal_name eq "svg") { set terminal svg noenhanced size 1100,460 background "white" font "sans,11"
} else { set terminal pdfcairo noenhanced size 11.00in,4.60in font "sans,8" }
set output "convergence_1.".terminal_name
set multiplot layout 1,2
set logscale xy
set format y "%.0e"
set title "0 %"
set xlabel "us"
set ylabel "distance to the optimum / u"
set key outside below maxcols 2
plot data index 0 using 3:5 with linespoints pt 7 ps 0.4 title "TinySolver (goniod model)", data index 1 using 3:5 with linespoints pt 7 ps 0.4 title "Solver dense QR (goniod model)", data index 2 using 3:5 with linespoints pt 7 ps 0.4 title "Solver normal Cholesky (goniod model)", data index 3 using 3:5 with linespoints pt 7 ps 0.4 title "MINPACK lmder (goniod model)", data index 4 using 3:5 with linespoints pt 7 ps 0.4 title "MINPACK lmder (plain model)", data index 5 using 3:5 with linespoints pt 7 ps 0.4 title "GSL multifit (goniod model)", data index 6 using 3:5 with linespoints pt 7 ps 0.4 title "GSL multifit (plain model)"
unset logscale
set logscale xy
set format y "%.0e"
set title "0 %"
set xlabel "us"
set ylabel "largest relative error against the truth"
set key outside below maxcols 2
plot data index 0 using 3:6 with linespoints pt 7 ps 0.4 title "TinySolver (goniod model)", data index 1 using 3:6 with linespoints pt 7 ps 0.4 title "Solver dense QR (goniod model)", data index 2 using 3:6 with linespoints pt 7 ps 0.4 title "Solver normal Cholesky (goniod model)", data index 3 using 3:6 with linespoints pt 7 ps 0.4 title "MINPACK lmder (goniod model)", data index 4 using 3:6 with linespoints pt 7 ps 0.4 title "MINPACK lmder (plain model)", data index 5 using 3:6 with linespoints pt 7 ps 0.4 title "GSL multifit (goniod model)", data index 6 using 3:6 with linespoints pt 7 ps 0.4 title "GSL multifit (plain model)"
unset logscale
unset multiplot
unset output
}
