# Figures 11 to 15 of the paper, drawn from the CSV files beside this script. Run it in their directory.
set datafile separator ','
set terminal pngcairo size 1200,900 font 'Sans,20' linewidth 2
set grid linecolor rgb '#dddddd'
set border linecolor rgb '#666666'
set style line 1 linewidth 2 linecolor rgb '#0b5394'
set style line 2 linewidth 2 linecolor rgb '#b45f06' dashtype 2
set style line 3 linewidth 0.7 linecolor rgb '#999999'
set style line 4 linewidth 2.5 linecolor rgb '#222222'
set style line 5 linewidth 2 linecolor rgb '#222222' pointtype 2 pointsize 2
set key top right box linecolor rgb '#dddddd' opaque

# Figs. 11 and 12: the cube at every tenth step, the first in bold, and the path of its centre of mass.
set size ratio -1
set xlabel 'x [cm]'
set ylabel 'y [cm]'
set xrange [-45:75]
set yrange [-5:85]
set object 1 rectangle from graph 0, graph 0 to graph 1, first 0 fillcolor rgb '#e8e8e8' fillstyle solid noborder behind
edge(a, b) = sprintf("'%s_x':'%s_y':(column('%s_x')-column('%s_x')):(column('%s_y')-column('%s_y'))", a, a, b, a, b, a)
AB = edge('a', 'b')
BC = edge('b', 'c')
CD = edge('c', 'd')
DA = edge('d', 'a')
do for [figure in '11 12'] {
  file = 'fig'.figure.'.csv'
  set output 'fig'.figure.'.png'
  set title 'Fig. '.figure.': '.(figure eq '11' ? 'energy-optimal projection' : 'traditional penalty method')
  plot file every 10 using @AB with vectors nohead linestyle 3 notitle, \
       file every 10 using @BC with vectors nohead linestyle 3 notitle, \
       file every 10 using @CD with vectors nohead linestyle 3 notitle, \
       file every 10 using @DA with vectors nohead linestyle 3 notitle, \
       file every ::0::0 using @AB with vectors nohead linestyle 4 notitle, \
       file every ::0::0 using @BC with vectors nohead linestyle 4 notitle, \
       file every ::0::0 using @CD with vectors nohead linestyle 4 notitle, \
       file every ::0::0 using @DA with vectors nohead linestyle 4 notitle, \
       file using 'x':'y' with lines linestyle 1 title 'centre of mass', \
       file every ::0::0 using 'x':'y' with points pointtype 6 pointsize 2.5 linewidth 2 linecolor rgb '#0b5394' notitle
}
unset object 1
set size noratio
set autoscale

set output 'fig13.png'
set title 'Fig. 13: centre of mass'
set key top left
mark(flag, y) = column(flag) == 1 ? column(y) : NaN
plot 'fig13.csv' using 'x':'y' with lines linestyle 1 title 'energy-optimal', \
     '' using 'x_traditional':'y_traditional' with lines linestyle 2 title 'traditional', \
     '' using 'x':(mark('starts_or_ends', 'y')) with points linestyle 5 title 'contact starts or ends', \
     '' using 'x_traditional':(mark('starts_or_ends_traditional', 'y_traditional')) with points linestyle 5 notitle

set xlabel 't [s]'
set output 'fig14.png'
set title 'Fig. 14: force along y'
set ylabel 'f_y [kg cm/s^2]'
set key top center
plot 'fig14.csv' using 't':'f_y' with lines linestyle 1 title 'energy-optimal', \
     '' using 't':'f_y_traditional' with lines linestyle 2 title 'traditional'

set output 'fig15.png'
set title 'Fig. 15: torque about z'
set ylabel 'τ_z [kg cm^2/s^2]'
set key bottom left
plot 'fig15.csv' using 't':'tau_z' with lines linestyle 1 title 'energy-optimal', \
     '' using 't':'tau_z_traditional' with lines linestyle 2 title 'traditional'
