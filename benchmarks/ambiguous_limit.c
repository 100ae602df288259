/* The limit for hypotheses on folds: one radar, one filter that remembers, by hand.

   As the study's kernel: threefry noise is replaced by a cheaper xoshiro256++, and of the estimates the squared errors
   of the mean alone are added. Hypotheses lie in arrays of eight; moving, weighing and the sums of the mean are
   written with vectors of eight doubles (AVX-512 where there is), branching is plain C.

   gcc -O3 -march=native -fno-math-errno -shared -fPIC -o ambiguous_limit.so ambiguous_limit.c -lm
*/
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef double v8 __attribute__((vector_size(64)));
typedef int64_t i8 __attribute__((vector_size(64)));

static uint64_t s[4];
static inline uint64_t turned(uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }
static inline uint64_t word(void) {
    uint64_t r = turned(s[0] + s[3], 23) + s[0], t = s[1] << 17;
    s[2] ^= s[0]; s[3] ^= s[1]; s[1] ^= s[2]; s[0] ^= s[3]; s[2] ^= t; s[3] = turned(s[3], 45);
    return r;
}
static void normals(double *a, double *b) {
    double r = sqrt(-2 * log((word() >> 11) * 0x1p-53 + 0x1p-54)), t = 2 * M_PI * ((word() >> 11) * 0x1p-53);
    *a = r * cos(t); *b = r * sin(t);
}
static inline v8 full(double x) { return (v8){x, x, x, x, x, x, x, x}; }
static inline v8 greater(v8 x, v8 y) { i8 m = x > y; return (v8)((m & (i8)x) | (~m & (i8)y)); }
static inline v8 nearest(v8 x) { const v8 m = full(0x1.8p52); v8 t = x + m; return t - m; }
static inline v8 exponential(v8 x) {
    x = greater(x, full(-700.0));
    v8 n = nearest(x * 1.4426950408889634), r = x - n * 0.6931471805599453;
    v8 p = full(1.0 / 479001600);
    static const double c[] = {1.0 / 39916800, 1.0 / 3628800, 1.0 / 362880, 1.0 / 40320, 1.0 / 5040, 1.0 / 720,
                               1.0 / 120, 1.0 / 24, 1.0 / 6, 0.5, 1, 1};
    for (int i = 0; i < 12; i++) p = p * r + c[i];
    i8 e = (__builtin_convertvector(n, i8) + 1023) << 52;
    return p * (v8)e;
}

enum { MOST = 4096 };
static _Alignas(64) double list[2][4][MOST], near_e[MOST], near_w[MOST];
static double child_w[4 * MOST], child_e[4 * MOST], copy[4 * MOST];
static int parent[4 * MOST];

static double least_kept(int n, int most) {
    memcpy(copy, child_w, n * sizeof *copy);
    int lo = 0, hi = n - 1, k = most - 1;
    while (lo < hi) {
        double p = copy[(lo + hi) / 2];
        int i = lo, j = hi;
        while (i <= j) {
            while (copy[i] > p) i++;
            while (copy[j] < p) j--;
            if (i <= j) { double t = copy[i]; copy[i++] = copy[j]; copy[j--] = t; }
        }
        if (k <= j) hi = j; else if (k >= i) lo = i; else break;
    }
    return copy[k];
}

/* gains: K rows of 1/(2 S_r), g (3), S_V, h (3). sums: K squared errors of the mean of the velocity. Returns the mean
   number of hypotheses. */
double run(int n, int scans, double dt, double sr, double sv, double span, double pv, double pa, int most, double deep,
           const double *gains, double *sums, uint64_t seed) {
    double kept = 0;
    for (int i = 0; i < 4; i++) s[i] = seed + 0x9E3779B97F4A7C15ull * (i + 1);
    for (int real = 0; real < n; real++) {
        int now = 0, count = 1;
        double V, A;
        normals(&V, &A);
        V *= pv; A *= pa;
        for (int k = 0; k < scans; k++) {
            const double *g = gains + 8 * k;
            double a, b, t = k * dt, D = span;
            normals(&a, &b);
            double zr = V * t + A * t * t / 2 + sr * a, u = V + A * t + sv * b, z = u - D * rint(u / D);
            double *r = list[now][0], *v = list[now][1], *acc = list[now][2], *w = list[now][3];
            int blocks = (count + 7) / 8;
            if (k == 0) {
                memset(list[now][0], 0, 64); memset(v, 0, 64); memset(acc, 0, 64);
                for (int i = 0; i < 8; i++) w[i] = i ? -1e300 : 0;
                r[0] = zr;
            } else
                for (int i = 0; i < blocks; i++) {
                    v8 R = ((v8 *)r)[i], U = ((v8 *)v)[i], B = ((v8 *)acc)[i];
                    R += dt * U + (0.5 * dt * dt) * B; U += dt * B;
                    v8 e = zr - R;
                    ((v8 *)r)[i] = R + g[1] * e; ((v8 *)v)[i] = U + g[2] * e; ((v8 *)acc)[i] = B + g[3] * e;
                    ((v8 *)w)[i] -= g[0] * e * e;
                }
            double c = 0.5 / g[4];
            v8 top = full(-1e300);
            for (int i = 0; i < blocks; i++) {
                v8 e = z - ((v8 *)v)[i];
                e -= D * nearest(e / D);
                v8 x = ((v8 *)w)[i] - c * e * e;
                ((v8 *)near_e)[i] = e; ((v8 *)near_w)[i] = x;
                top = greater(x, top);
            }
            double best = top[0];
            for (int i = 1; i < 8; i++) best = fmax(best, top[i]);
            double least = best - deep;
            int made = 0;
            for (int i = 0; i < count; i++) {
                if (near_w[i] < least) continue;
                double low = fmax(least, near_w[i] - 40), e = near_e[i];
                child_w[made] = near_w[i]; child_e[made] = e; parent[made++] = i;
                for (double f = e + D;; f += D) {
                    double x = w[i] - c * f * f;
                    if (x < low) break;
                    child_w[made] = x; child_e[made] = f; parent[made++] = i;
                }
                for (double f = e - D;; f -= D) {
                    double x = w[i] - c * f * f;
                    if (x < low) break;
                    child_w[made] = x; child_e[made] = f; parent[made++] = i;
                }
            }
            double cut = made > most ? least_kept(made, most) : -1e300;
            double *R = list[1 - now][0], *U = list[1 - now][1], *B = list[1 - now][2], *W = list[1 - now][3];
            count = 0;
            for (int i = 0; i < made; i++)
                if (child_w[i] >= cut && count < most) {
                    int j = parent[i];
                    R[count] = r[j] + g[5] * child_e[i];
                    U[count] = v[j] + g[6] * child_e[i];
                    B[count] = acc[j] + g[7] * child_e[i];
                    W[count++] = child_w[i] - best;
                }
            for (int i = count; i < (count + 7) / 8 * 8; i++) R[i] = U[i] = B[i] = 0, W[i] = -1e300;
            now = 1 - now;
            v8 all = full(0), mv = full(0), mr = full(0), ma = full(0);
            for (int i = 0; i < (count + 7) / 8; i++) {
                v8 x = exponential(((v8 *)W)[i]);
                all += x; mr += x * ((v8 *)R)[i]; mv += x * ((v8 *)U)[i]; ma += x * ((v8 *)B)[i];
            }
            double p = 0, m = 0;
            for (int i = 0; i < 8; i++) p += all[i], m += mv[i];
            double e = m / p - (V + A * t);
            sums[k] += e * e;
            kept += count;
        }
    }
    return kept / n / scans;
}
