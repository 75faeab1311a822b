# Draws the figures of a run from run.csv and ticks.csv. Run it in their directory. `terminal` is svg,
# pdf or png; `one` is the file for all figures; if it is empty, each figure is a file.
set datafile separator ','
wide = one eq '' ? 1 : 2
if (terminal eq 'svg') set terminal svg size (wide == 1 ? 720 : 1300),(wide == 1 ? 440 : 1300) dynamic font 'DejaVu Sans,13' linewidth 1.2 background '#ffffff'
if (terminal eq 'pdf') set terminal pdfcairo size (wide == 1 ? 5 : 10.5),(wide == 1 ? 3.1 : 10.5) font 'DejaVu Sans,10' linewidth 1.2
if (terminal eq 'png') set terminal pngcairo size (wide == 1 ? 1440 : 2400),(wide == 1 ? 880 : 2400) font 'DejaVu Sans,22' linewidth 2.2
set grid linecolor rgb '#e2e2e2' linetype 1 linewidth 0.6
set border 3 linecolor rgb '#666666'
set tics nomirror textcolor rgb '#333333'
set key at graph 1, graph 1.02 right bottom horizontal samplen 1.4 width -1 textcolor rgb '#333333'
# Colours of Okabe and Ito, safe for colour-blind readers. The magnitude is grey, behind its components.
set style line 1 linewidth 1.3 linecolor rgb '#0072b2'
set style line 2 linewidth 1.3 linecolor rgb '#d55e00'
set style line 3 linewidth 1.3 linecolor rgb '#009e73'
set style line 4 linewidth 1.8 linecolor rgb '#222222'
set style line 6 linewidth 3.2 linecolor rgb '#c8c8c8'
set style line 5 linewidth 1.3 linecolor rgb '#9a9a9a'
set style fill solid 0.55 noborder
stats 'run.csv' using 't' nooutput name 'T'
begin_s = T_min
end_s = T_max > T_min ? T_max : T_min + 1

if (one ne '') {
  set output one
  set multiplot layout 3,2 margins 0.07,0.97,0.05,0.93 spacing 0.13,0.10
  set label 9 title noenhanced at screen 0.5, screen 0.975 center font (terminal eq 'png' ? ',30' : terminal eq 'svg' ? ',17' : ',13')
}
figure(name) = sprintf('%s.%s', name, terminal)

set xrange [begin_s:end_s]
set xlabel 'time [s]'

if (one eq '') { set output figure('force') }
set ylabel 'force on the hand [N]'
set yrange [*<-0.1:0.1<*]
plot 'run.csv' using 't':'f' with lines linestyle 6 title 'magnitude', '' using 't':'fx' with lines linestyle 1 title 'x', \
     '' using 't':'fy' with lines linestyle 2 title 'y', '' using 't':'fz' with lines linestyle 3 title 'z'

if (one eq '') { set output figure('torque') }
unset label 9
set ylabel 'torque on the hand [mN·m]'
set yrange [*<-1:1<*]
plot 'run.csv' using 't':'torque' with lines linestyle 6 title 'magnitude', '' using 't':'tx' with lines linestyle 1 title 'x', \
     '' using 't':'ty' with lines linestyle 2 title 'y', '' using 't':'tz' with lines linestyle 3 title 'z'

if (one eq '') { set output figure('penetration') }
set ylabel 'from p to q [mm]'
set y2label 'rotation from p to q [°]'
set border 11
set y2tics nomirror
set yrange [0:0.1<*]
set y2range [0:0.1<*]
if (proxy_valid) {
  plot 'run.csv' using 't':'depth_mm' with lines linestyle 1 title 'distance (left)', \
       '' using 't':'rotation_deg' axes x1y2 with lines linestyle 2 title 'rotation (right)'
} else {
  set label 1 'the proxy was never initialised' at graph 0.5, graph 0.5 center textcolor rgb '#777777'
  plot [begin_s:end_s] [0:1] 2 notitle
  unset label 1
}
unset y2label
unset y2tics
set border 3
set autoscale y

if (one eq '') { set output figure('energy') }
set ylabel 'energy since the force began [mJ]'
set yrange [*<0:0.1<*]
plot 'run.csv' using 't':'in_mJ' with lines linestyle 1 title 'from the hand', \
     '' using 't':'out_mJ' with lines linestyle 2 title 'to the hand', \
     '' using 't':(column('in_mJ')-column('out_mJ')) with lines linestyle 4 title 'stored or dissipated', \
     '' using 't':'injected_mJ' with lines linestyle 3 title 'generated'

# Distribution of tick durations and wake latencies. The tail matters for the hand.
if (one eq '') { set output figure('ticks') }
set autoscale x
set xlabel 'tick duration and wake latency [µs]'
set ylabel 'fraction of ticks'
if (timed) {
  stats 'ticks.csv' using 'to_us' nooutput name 'U'
  stats 'ticks.csv' using 'durations' nooutput name 'K'
  set logscale xy
  set format '10^{%T}'
  set xrange [1:(period_us > U_max ? 1.3 * period_us : 1.3 * U_max)]
  set yrange [0.5 / K_sum:1.3]
  set arrow 1 from period_us, graph 0 to period_us, graph 1 nohead linestyle 5 dashtype 2
  set label 1 'period ' at period_us, graph 0.96 right textcolor rgb '#777777'
  plot 'ticks.csv' using 'from_us':(column('durations') > 0 ? column('durations') / K_sum : NaN) with fillsteps linecolor rgb '#c4dbec' title 'histogram', \
       '' using 'from_us':'duration_tail' with steps linestyle 1 title 'duration above', \
       '' using 'from_us':'latency_tail' with steps linestyle 2 title 'latency above'
} else {
  set label 1 'virtual time: ticks have no duration' at graph 0.5, graph 0.5 center textcolor rgb '#777777'
  plot [0:1] [0:1] 2 notitle
}
unset arrow 1
unset label 1
unset logscale
set format
set autoscale

# Path of the tool, in the vertical plane with the largest extent.
if (one eq '') { set output figure('trajectory') }
stats 'run.csv' using (column('px')) nooutput name 'PX'
stats 'run.csv' using (column('py')) nooutput name 'PY'
across = PY_max - PY_min > PX_max - PX_min ? 'y' : 'x'
set xlabel across.' of the tool in the world [mm]'
set ylabel 'z of the tool in the world [mm]'
set size ratio -1
span = PX_max - PX_min > PY_max - PY_min ? PX_max - PX_min : PY_max - PY_min
if (span > 0) { set xtics 10**floor(log10(span)) * (span / 10**floor(log10(span)) > 3 ? 2 : 1) / (span / 10**floor(log10(span)) > 3 ? 1 : 2.0) }
set offsets graph 0.05, graph 0.05, graph 0.05, graph 0.05
if (proxy_valid) {
  plot 'run.csv' using (column('p'.across)):(column('pz')) with lines linestyle 5 title 'p, commanded pose', \
       '' using (column('q'.across)):(column('qz')) with lines linestyle 1 title 'q, proxy pose'
} else {
  plot 'run.csv' using (column('p'.across)):(column('pz')) with lines linestyle 5 title 'p, commanded pose'
}
if (one ne '') { unset multiplot }
unset output
