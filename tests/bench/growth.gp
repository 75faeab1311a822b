# Plots the cost of contact by the number of triangles from the output of bench_contact --csv.
# Usage: gnuplot -c growth.gp RESULTS.csv PICTURE.svg
set datafile separator ','
set datafile missing NaN
set terminal svg size 900,600 font 'Sans,16' linewidth 1.5 background '#ffffff'
set output ARG2
set grid linecolor rgb '#dddddd'
set border linecolor rgb '#666666'
set key top left box linecolor rgb '#dddddd' opaque
set logscale xy
set format x '%.0s%c'
set xlabel 'triangles of the obstacle'
set ylabel 'one pose [us]'
set title 'A tool of 10k triangles on a boulder: p50, and p99 dashed'

# Each line of the file is a cell: table,case,method,column,value. The case of the growth table is the count.
cell(method, quantile) = strcol('table')[1:7] eq 'growth:' && strcol('method') eq method && strcol('column') eq quantile ? column('value') : NaN
count(method, quantile) = strcol('table')[1:7] eq 'growth:' && strcol('method') eq method && strcol('column') eq quantile ? column('case') : NaN
method(i) = i == 1 ? 'wrenchd all pairs' : 'wrenchd whole tick'
colour(i) = i == 1 ? '#b45f06' : '#0b5394'
plot for [i=1:2] ARG1 using (count(method(i), 'p50')):(cell(method(i), 'p50')) with linespoints pointtype 7 linecolor rgb colour(i) title method(i), \
     for [i=1:2] ARG1 using (count(method(i), 'p99')):(cell(method(i), 'p99')) with lines dashtype 2 linecolor rgb colour(i) notitle
