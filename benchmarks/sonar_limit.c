/* The limits of P3's scans where each realisation has misses of its own, and of its detectors, by hand.

   The same noise and arithmetic as the study's kernels (letters as in radarsim/studies/sonar/kernels/steps.py), eight
   realisations at once; sizes are constants, what several detectors need is made once, and nothing is asked that is
   known beforehand. Two coordinates, no random course.
   gcc -O3 -march=native -fno-math-errno -shared -fPIC -o sonar_limit.so sonar_limit.c -lm */
#include "lanes.h"
#include <string.h>

enum { GROUPS = 32, ROWS = 22, SUMS = 29, MOST_FILTERS = 4, MOST_PLOTS = 16, MOST_DETECTORS = 8, MOST_LEVELS = 8 };

typedef struct {
    int scans, filters;
    double limit, period; /* probability of a plot */
    const uint64_t *plots, *misses;
    const int64_t *certain, *size, *covariance;
    const double *dt, *truth, *steps, *fresh, *carry, *manoeuvre, *sigma;
} World;

/* ---- small matrices, packed by rows ---- */
IN void inverse2(const v8 *y, v8 rank, v8 *p) {
    v8 one = full(1), zero = full(0), least = full(0.5), half = full(1.5);
    v8 d = where_greater(rank, half, y[0] * y[3] - y[1] * y[1], where_greater(rank, least, y[0], one)), s = 1.0 / d;
    p[0] = s * where_greater(rank, half, y[3], where_greater(rank, least, one, zero));
    p[1] = s * where_greater(rank, half, -y[1], zero), p[3] = s * where_greater(rank, half, y[0], zero);
    p[2] = p[4] = p[5] = zero;
}
IN void inverse3(const v8 *y, v8 rank, v8 *p) {
    v8 one = full(1), zero = full(0), least = full(0.5), half = full(1.5), most = full(2.5);
    v8 c0 = y[3] * y[5] - y[4] * y[4], c1 = y[2] * y[4] - y[1] * y[5], c2 = y[1] * y[4] - y[2] * y[3];
    v8 minor = y[0] * y[3] - y[1] * y[1];
    v8 d = where_greater(rank, half, minor, where_greater(rank, least, y[0], one));
    v8 s = 1.0 / where_greater(rank, most, y[0] * c0 + y[1] * c1 + y[2] * c2, d);
    p[0] = s * where_greater(rank, most, c0, where_greater(rank, half, y[3], where_greater(rank, least, one, zero)));
    p[1] = s * where_greater(rank, most, c1, where_greater(rank, half, -y[1], zero));
    p[2] = s * where_greater(rank, most, c2, zero);
    p[3] = s * where_greater(rank, most, y[0] * y[5] - y[2] * y[2], where_greater(rank, half, y[0], zero));
    p[4] = s * where_greater(rank, most, y[1] * y[2] - y[0] * y[4], zero), p[5] = s * where_greater(rank, most, minor, zero);
}
IN void inverse(int size, const v8 *y, v8 rank, v8 *p) { size == 3 ? inverse3(y, rank, p) : inverse2(y, rank, p); }

/* ---- one scan of a filter: memory m is x (4), Y (8), J (10), each a row of a group ---- */
IN void scan_of(int size, int joint, v8 *m, v8 z, v8 w, v8 n, double dt, double period, double c, double q, v8 *p) {
    v8 zero = full(0), one = full(1), *x = m, *y = m + 4, *j = m + 12, k[4];
    double tau = dt / period, half = 0.5 * tau * tau;
    v8 got = where_greater(w, zero, one, zero), age = y[6] + tau, last = y[7] * c, fresh = w / (1.0 - last * last);
    v8 u0 = half * y[0] - tau * y[1] + y[2], u1 = half * y[1] - tau * y[3] + y[4], u2 = half * y[2] - tau * y[4] + y[5];
    v8 y11 = tau * (tau * y[0] - 2.0 * y[1]) + y[3], y01 = y[1] - tau * y[0];
    v8 h0 = 1.0 - last, h1 = last * age, h2 = size == 3 ? -0.5 * h1 * age : zero;
    y[1] = y01 + fresh * h0 * h1, y[3] = y11 + fresh * h1 * h1, y[0] += fresh * h0 * h0;
    if (size == 3)
        y[2] = u0 + fresh * h0 * h2, y[4] = u1 - tau * u0 + fresh * h1 * h2, y[5] = half * u0 - tau * u1 + u2 + fresh * h2 * h2;
    v8 rank = n + got, most = full(size);
    inverse(size, y, where_greater(rank, most, most, rank), p);
    h0 *= fresh, h1 *= fresh, h2 *= fresh;
    k[0] = p[0] * h0 + p[1] * h1 + p[2] * h2, k[1] = p[1] * h0 + p[3] * h1 + p[4] * h2, k[2] = p[2] * h0 + p[4] * h1 + p[5] * h2;
    k[3] = c != 0.0 ? where_greater(w, zero, 1.0 - k[0], zero) : zero;
    y[6] = where_greater(w, zero, zero, age), y[7] = where_greater(w, zero, one, last);
    if (joint) { /* of a line: the third component is zero */
        v8 a0 = j[0] + tau * j[1], a1 = j[1] + tau * j[3], e0 = c * (j[6] + tau * j[7]), e1 = c * j[7];
        v8 p0 = a0 + tau * a1 + q * half * half, p1 = a1 + q * half * tau, p3 = j[3] + q * tau * tau;
        v8 ee = c * c * j[9] + (1.0 - c * c) / where_greater(w, zero, w, one);
        v8 g0 = p0 + e0, g1 = p1 + e1, g3 = e0 + ee, s = g0 + g3, per = got / s, started = full(size);
        v8 k0 = g0 * per, k1 = g1 * per, k3 = g3 * per, r0 = k0 * s - g0, r1 = k1 * s - g1, r3 = k3 * s - g3;
        p0 += k0 * r0 - g0 * k0, p1 += k0 * r1 - g0 * k1, p3 += k1 * r1 - g1 * k1;
        e0 += k0 * r3 - g0 * k3, e1 += k1 * r3 - g1 * k3, ee += k3 * r3 - g3 * k3;
        p[0] = where_greater(started, n, p[0], p0), p[1] = where_greater(started, n, p[1], p1);
        p[3] = where_greater(started, n, p[3], p3);
        j[0] = p[0], j[1] = p[1], j[3] = p[3];
        j[6] = where_greater(started, n, -p[0], e0), j[7] = where_greater(started, n, -p[1], e1);
        j[9] = where_greater(started, n, p[0], ee);
        k[0] = where_greater(started, n, k[0], k0), k[1] = where_greater(started, n, k[1], k1);
        k[3] = where_greater(started, n, k[3], c != 0.0 ? k3 : zero);
    }
    double per = 1.0 / period;
    v8 r = x[0] + dt * (x[1] + 0.5 * dt * x[2]), v = x[1] + dt * x[2], e = c * x[3], innovation = z - r - e;
    x[0] = r + k[0] * innovation, x[1] = v + per * k[1] * innovation, x[3] = e + k[3] * innovation;
    if (size == 3) x[2] += per * per * k[2] * innovation;
}

/* ---- sums of a filter, coordinate and scan, kept in the order of `SUMS` ---- */
IN void powers(v8 e, v8 known, v8 *s) {
    e *= known;
    v8 ee = e * e;
    s[0] += e, s[1] += ee, s[2] += ee * e, s[3] += ee * ee;
}
IN void add(int size, const v8 *x, const v8 *p, const v8 *base, int size_base, const double *truth, v8 n, double sigma,
            double period, v8 *s) {
    v8 zero = full(0), one = full(1), e[3] = {zero, zero, zero}, y[6], whole = where_greater(n, full(size - 0.5), one, zero);
    static const int diagonal[] = {0, 3, 5};
    double scale[] = {1 / sigma, period / sigma, period * period / sigma};
    for (int j = 0; j < size; j++) {
        v8 known = where_greater(n, full(j + 0.5), one, zero), f = base[j] - truth[j];
        e[j] = x[j] - truth[j];
        powers(e[j], known, s + 4 * j);
        if (j < size_base) s[12 + j] += known * e[j] * e[j] * f * f;
        s[15 + j] += known, s[18 + j] += known * p[diagonal[j]], e[j] *= scale[j];
    }
    inverse(size, p, where_greater(n, full(size - 0.5), full(size), zero), y);
    v8 q = e[0] * (y[0] * e[0] + 2.0 * (y[1] * e[1] + y[2] * e[2])) + e[1] * (y[3] * e[1] + 2.0 * y[4] * e[2]) + y[5] * e[2] * e[2];
    v8 both = whole * (sigma * sigma / period * (e[0] * e[1]));
    q *= whole, s[21] += q, s[22] += q * q, s[23] += both, s[24] += both * both;
}
IN void one_filter(const World *o, int f, int c, int k, int size, int joint, v8 *memory, const v8 *base, const v8 *z,
                   const v8 *w, const v8 *n, v8 *restrict s) {
    int at = k * 2 + c, of = (f * o->scans + k) * 2 + c;
    double dt = o->dt[k], half = 0.5 * dt * dt;
    for (int i = 0; i < GROUPS; i++) {
        v8 *m = memory + i * ROWS, p[6];
        if (k > 0) {
            v8 known = where_greater(n[i], full(size - 0.5), full(1), full(0));
            powers(m[0] + dt * m[1] + half * m[2] - o->truth[3 * at], known, s + 25);
        }
        scan_of(size, joint, m, z[i], w[i], n[i], dt, o->period, o->carry[of], o->manoeuvre[2 * f + c], p);
        v8 now = n[i] + where_greater(w[i], full(0), full(1), full(0));
        add(size, m, p, base + i * ROWS, o->size[0], o->truth + 3 * at, now, o->sigma[c], o->period, s);
    }
}

/* Plots z and weights w of scan k, 1 or 0; error is carried on. */
IN void plots_of(const World *o, uint64_t first, int k, v8 (*error)[GROUPS], v8 (*z)[GROUPS], v8 *w) {
    u8 lanes = {0, 1, 2, 3, 4, 5, 6, 7};
    for (int i = 0; i < GROUPS; i++) {
        u8 realisation = lanes + (first + 8 * i), x, y;
        v8 noise[2];
        normals(realisation, k, o->plots, noise, noise + 1);
        for (int c = 0; c < 2; c++) {
            error[c][i] = o->steps[2 * k + c] * error[c][i] + o->fresh[2 * k + c] * noise[c];
            z[c][i] = o->truth[3 * (2 * k + c)] + error[c][i];
        }
        threefry(realisation, k, o->misses[0], o->misses[1], &x, &y);
        w[i] = o->certain[k] >= 0 ? full(o->certain[k]) : where_greater(full(o->limit), uniform(x), full(1), full(0));
    }
}
/* One scan of all filters, and its sums. */
IN void filters_of(const World *o, int k, v8 (*memory)[2][GROUPS * ROWS], v8 (*z)[GROUPS], const v8 *w, const v8 *n,
                   double *sums) {
    for (int c = 0; c < 2; c++)
        for (int f = 0; f < o->filters; f++) {
            v8 s[SUMS] = {0}, *m = memory[f][c], *base = memory[0][c];
            if (o->covariance[f]) one_filter(o, f, c, k, 2, 1, m, base, z[c], w, n, s);
            else if (o->size[f] == 3) one_filter(o, f, c, k, 3, 0, m, base, z[c], w, n, s);
            else one_filter(o, f, c, k, 2, 0, m, base, z[c], w, n, s);
            double *to = sums + ((f * o->scans + k) * 2 + c) * SUMS;
            for (int j = 0; j < SUMS; j++) to[j] += total(s[j]);
        }
}

/* sums (F, K, 2, SUMS) of realisations first … first + count - 1, a multiple of 8 GROUPS; gains are of filter 0. */
void own_misses(const World *o, uint64_t first, int count, double *sums) {
    static __thread v8 memory[MOST_FILTERS][2][GROUPS * ROWS], error[2][GROUPS], z[2][GROUPS], w[GROUPS], n[GROUPS];
    for (int done = 0; done < count; done += 8 * GROUPS) {
        memset(memory, 0, sizeof memory), memset(error, 0, sizeof error), memset(n, 0, sizeof n);
        for (int k = 0; k < o->scans; k++) {
            plots_of(o, first + done, k, error, z, w);
            filters_of(o, k, memory, z, w, n, sums);
            for (int i = 0; i < GROUPS; i++) n[i] += w[i];
        }
    }
}

/* ---- detectors ---- */
typedef struct {
    int count, longest, most; /* detectors, rising in plots; the most plots and thresholds of one */
    const int64_t *plots, *every, *levels, *phase;
    const double *threshold;
} Detectors;

/* Statistics T of all detectors due at scan k, in one coordinate: one pass over the last plots. */
IN void statistics(const Detectors *d, int k, v8 *recent, v8 z, v8 w, v8 n, double tau, double sigma, v8 T[][3], int c) {
    v8 zero = full(0), one = full(1), half = full(0.5), *age = recent + MOST_PLOTS, *weight = age + MOST_PLOTS;
    for (int j = d->longest - 1; j > 0; j--) {
        recent[j] = where_greater(w, zero, recent[j - 1], recent[j]);
        age[j] = where_greater(w, zero, age[j - 1], age[j]) + tau;
        weight[j] = where_greater(w, zero, weight[j - 1], weight[j]);
    }
    recent[0] = where_greater(w, zero, z, recent[0]), age[0] = where_greater(w, zero, zero, age[0] + tau);
    weight[0] = where_greater(w, zero, w, weight[0]);
    v8 y[6] = {zero, zero, zero, zero, zero, zero}, b0 = zero, b1 = zero, b2 = zero, tested = where_greater(w, zero, n, zero);
    for (int i = 0, j = 0; i < d->count; i++) {
        for (; j < d->plots[i]; j++) {
            v8 u = recent[j] - recent[0], h1 = -age[j], h2 = half * age[j] * age[j], w1 = weight[j] * h1, w2 = weight[j] * h2;
            y[0] += weight[j], y[1] += w1, y[2] += w2, y[3] += w1 * h1, y[4] += w1 * h2, y[5] += w2 * h2;
            b0 += weight[j] * u, b1 += w1 * u, b2 += w2 * u;
        }
        T[i][c] = full(-1);
        if ((k + 1 - d->plots[i]) % d->every[i]) continue;
        v8 p[6], enough = full(d->plots[i] - 0.5);
        inverse3(y, where_greater(tested, enough, full(3), zero), p);
        v8 a = p[2] * b0 + p[4] * b1 + p[5] * b2, value = 1 / (sigma * sigma) * (a * a);
        T[i][c] = where_greater(tested, enough, value / where_greater(tested, enough, p[5], one), full(-1));
    }
}

/* sums as of own_misses; alarms (D, 3, K, 1 + 2 most): tested, then by threshold alarms and first events of a phase. */
void detected(const World *o, const Detectors *d, uint64_t first, int count, double *sums, double *alarms) {
    static __thread v8 memory[MOST_FILTERS][2][GROUPS * ROWS], error[2][GROUPS], z[2][GROUPS], w[GROUPS], n[GROUPS];
    static __thread v8 recent[2][GROUPS][3 * MOST_PLOTS], passed[MOST_DETECTORS][3][MOST_LEVELS][GROUPS];
    static __thread v8 T[GROUPS][MOST_DETECTORS][3];
    v8 zero = full(0), one = full(1), least = full(-0.5), none = full(-1);
    for (int done = 0; done < count; done += 8 * GROUPS) {
        memset(memory, 0, sizeof memory), memset(error, 0, sizeof error), memset(n, 0, sizeof n);
        memset(recent, 0, sizeof recent);
        for (int k = 0; k < o->scans; k++) {
            if (k == 0 || d->phase[k] != d->phase[k - 1]) memset(passed, 0, sizeof passed);
            plots_of(o, first + done, k, error, z, w);
            for (int i = 0; i < GROUPS; i++) {
                for (int c = 0; c < 2; c++)
                    statistics(d, k, recent[c][i], z[c][i], w[i], n[i] + w[i], o->dt[k] / o->period, o->sigma[c], T[i], c);
                for (int j = 0; j < d->count; j++) {
                    v8 *t = T[i][j], r = where_greater(t[0], least, t[0], none);
                    t[2] = where_greater(t[1], least, where_greater(r, least, r + t[1], none), none);
                }
            }
            for (int j = 0; j < d->count; j++) {
                if ((k + 1 - d->plots[j]) % d->every[j]) continue;
                for (int g = 0; g < 3; g++) {
                    double *to = alarms + ((j * 3 + g) * o->scans + k) * (1 + 2 * d->most);
                    v8 tested = zero, found[MOST_LEVELS] = {0}, fresh[MOST_LEVELS] = {0};
                    for (int i = 0; i < GROUPS; i++) {
                        v8 value = T[i][j][g], any = where_greater(value, least, one, zero);
                        tested += any;
                        for (int l = 0; l < d->levels[j]; l++) {
                            v8 level = full(d->threshold[(j * 3 + g) * d->most + l]), alarm = where_greater(value, level, one, zero);
                            v8 *past = &passed[j][g][l][i], event = d->phase[k] == 2 ? any - alarm : alarm;
                            event = where_greater(event, *past, event, zero), *past += event;
                            found[l] += alarm, fresh[l] += event;
                        }
                    }
                    to[0] += total(tested);
                    for (int l = 0; l < d->levels[j]; l++) to[1 + 2 * l] += total(found[l]), to[2 + 2 * l] += total(fresh[l]);
                }
            }
            filters_of(o, k, memory, z, w, n, sums);
            for (int i = 0; i < GROUPS; i++) n[i] += w[i];
        }
    }
}
