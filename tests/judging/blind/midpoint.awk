# The explicit midpoint rule on (e, L) in awk; with -v OUT=%.6g it writes six digits.
function field(y, d) {
    d[1] = (y[5] * y[3] - y[6] * y[2]) / I1; d[2] = (y[6] * y[1] - y[4] * y[3]) / I1
    d[3] = (y[4] * y[2] - y[5] * y[1]) / I1; d[4] = -mgl * y[2]; d[5] = mgl * y[1]; d[6] = 0
}
{
    if (!OUT) OUT = "%.17g"
    I1 = $1; mgl = $3; h = $4; n = $5; stride = $6
    for (i = 1; i <= 6; i++) y[i] = $(6 + i)
    for (k = 0; k <= n; k++) {
        if (k % stride == 0) { for (i = 1; i <= 6; i++) printf OUT " ", y[i]; printf "\n" }
        field(y, a)
        for (i = 1; i <= 6; i++) z[i] = y[i] + h / 2 * a[i]
        field(z, b)
        for (i = 1; i <= 6; i++) y[i] += h * b[i]
    }
}
