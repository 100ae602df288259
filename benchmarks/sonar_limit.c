/* The limits of P3's scans where each realisation has misses of its own, of its detectors and its tracker, by hand.

   The same noise and arithmetic as the study's kernels (letters as in radarsim/studies/sonar/kernels/steps.py), eight
   realisations at once; sizes are constants, what several detectors need is made once, and nothing is asked that is
   known beforehand. Two coordinates, no random course. Last the tracker among false plots: letters as in
   radarsim/studies/sonar/clutter/kernels; one tracker, and a sector that is not a full circle.
   gcc -O3 -march=native -fno-math-errno -shared -fPIC -o sonar_limit.so sonar_limit.c -lm */
#include "lanes.h"
#include <string.h>

enum { GROUPS = 32, ROWS = 22, SUMS = 29, MOST_FILTERS = 4, MOST_PLOTS = 16, MOST_DETECTORS = 8, MOST_LEVELS = 8,
       TRACKS = 8 * GROUPS, STRIP = 512, MOST_IN_CELL = 40, MOST_SCORES = 40 };

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

/* ---- tracks among false plots ---- */
typedef struct {
    int joint, nq, nb, levels, shares;
    double gate, m, n, most, speed, lost, detection, inside, assumed;
    double q0, dq, b0, db, density;
    const uint64_t *field, *about, *seeds; /* keys: false plots about the target and about false tracks, their places */
    const double *share, *threshold, *manoeuvre;
} Tracker;

/* What a group of eight tracks keeps: lines x, vx, covariance (3) in range and bearing, C between them; the life of a
   track; and of one scan the prediction and the plots in the gate. age: since the first plot, in periods. */
typedef struct {
    v8 r, vr, b, vb, pr[3], pb[3], c[4], n, age, kept;
    v8 state, scans, hits, misses, since, score, best, first, before, ends, held, wrong, taken;
    v8 S[3], I[3], det, least, most, high, count, false_count, d, nu_r, nu_b, nearest, weight, bad, mr, mb, rr, rb, bb;
} Group;
enum { TRYING, KEPT, FOUND, LOST, DROPPED, FAILED, LOOKED, PLOTS, INSIDE, FALSE, EXPECTED, COUNTS };

IN v8 exponential(v8 x) {
    x = where_greater(x, full(-700), x, full(-700));
    v8 shifted = x * 1.4426950408889634 + 0x1.8p52, n = shifted - 0x1.8p52;
    v8 r = x - n * 0.693147180369123816 - n * 1.90821492927058770e-10, p = r * (1.0 / 479001600) + 1.0 / 39916800;
    p = p * r + 1.0 / 3628800, p = p * r + 1.0 / 362880, p = p * r + 1.0 / 40320, p = p * r + 1.0 / 5040;
    p = p * r + 1.0 / 720, p = p * r + 1.0 / 120, p = p * r + 1.0 / 24, p = p * r + 1.0 / 6, p = p * r + 0.5;
    p = p * r + 1.0, p = p * r + 1.0;
    return p * (v8)(((i8)shifted + 1023) << 52);
}
IN v8 greater(v8 x, v8 y) { return where_greater(x, y, full(1), full(0)); }
IN v8 larger(v8 x, v8 y) { return where_greater(x, y, x, y); }
IN v8 smaller(v8 x, v8 y) { return where_greater(x, y, y, x); }
IN double at(const v8 *x, int i) { return ((const double *)x)[i]; }

IN void predict(const World *o, const Tracker *t, Group *g, double dt) {
    double tau = dt / o->period, half = 0.5 * tau * tau, sr = o->sigma[0], sb = o->sigma[1];
    v8 settled = greater(g->n, full(1.5)), alive = greater(g->state, full(0.5));
    for (int c = 0; c < 2; c++) {
        v8 *p = c ? g->pb : g->pr, a = p[0] + tau * p[1], low = p[1] + tau * p[2], use = settled;
        double q = t->manoeuvre[c];
        p[0] = where_greater(use, full(0.5), a + tau * low + q * half * half, p[0]);
        p[1] = where_greater(use, full(0.5), low + q * half * tau, p[1]);
        p[2] = where_greater(use, full(0.5), p[2] + q * tau * tau, p[2]);
    }
    v8 top = g->c[0] + tau * g->c[2], low = g->c[1] + tau * g->c[3];
    g->c[0] = top + tau * low, g->c[1] = low, g->c[2] += tau * g->c[3];
    g->r += dt * g->vr, g->b += dt * g->vb, g->age += tau, g->since += dt * alive;
    v8 reach = where_greater(settled, full(0.5), full(0), t->speed * g->since), across = reach / larger(g->r, full(1));
    g->S[0] = sr * sr * (g->pr[0] + 1) + reach * reach, g->S[1] = sr * sb * g->c[0];
    g->S[2] = sb * sb * (g->pb[0] + 1) + across * across;
    g->det = g->S[0] * g->S[2] - g->S[1] * g->S[1];
    v8 per = 1 / g->det, wide = root(t->gate * g->S[0]), near = larger(g->r - wide, full(0)), far = g->r + wide;
    g->I[0] = g->S[2] * per, g->I[1] = -g->S[1] * per, g->I[2] = g->S[0] * per;
    g->high = root(t->gate * g->S[2]), g->least = 0.5 * near * near, g->most = 0.5 * far * far;
}

/* One more plot in the gates of a group: where got is 1. */
IN void take(Group *g, v8 nu_r, v8 nu_b, v8 d, v8 e, v8 got) {
    v8 half = full(0.5), new = where_greater(g->d, d, got, full(0));
    g->count += got;
    g->d = where_greater(new, half, d, g->d), g->nu_r = where_greater(new, half, nu_r, g->nu_r);
    g->nu_b = where_greater(new, half, nu_b, g->nu_b);
    e = where_greater(e, full(1e-300), e * got, full(0)), g->weight += e;
    g->mr = where_greater(e, full(0), nu_r, g->mr), g->mb = where_greater(e, full(0), nu_b, g->mb);
}
IN void open_gates(const Tracker *t, Group *g, v8 z_r, v8 z_b, v8 detected, v8 *counts) {
    v8 zero = full(0), looks = greater(g->n, full(1.5)), nu_r = z_r - g->r, nu_b = z_b - g->b;
    v8 d = g->I[0] * nu_r * nu_r + 2 * g->I[1] * nu_r * nu_b + g->I[2] * nu_b * nu_b;
    v8 got = where_greater(d, full(t->gate), zero, detected * greater(g->state, full(0.5)));
    g->count = g->false_count = g->nearest = g->weight = g->bad = g->mr = g->mb = g->rr = g->rb = g->bb = zero;
    g->d = full(1e30), g->nu_r = g->nu_b = zero, looks *= greater(g->state, full(0.5));
    take(g, nu_r, nu_b, d, exponential(-0.5 * d), got);
    double sector = t->dq * t->nq * t->db * t->nb;
    v8 area = larger(g->r, zero) * M_PI * t->gate * root(g->det);
    counts[LOOKED] += looks, counts[PLOTS] += looks * detected, counts[INSIDE] += looks * got;
    if (t->density > 0) counts[EXPECTED] += looks * t->density * smaller(area, full(sector));
}

/* ---- false plots: cells of several tracks side by side, then their plots ---- */
typedef struct {
    int cells, plots;
    uint64_t realisation[STRIP + 8], number[STRIP + 8], again[STRIP * MOST_IN_CELL / 2 + 8], which[STRIP * MOST_IN_CELL / 2 + 8];
    int track[STRIP + 8], many[STRIP + 8], from[STRIP + 8];
    double q[STRIP + 8], b[STRIP + 8];
    uint64_t x[STRIP + 8], y[STRIP + 8], more[STRIP * MOST_IN_CELL + 16];
    double at_q[STRIP * MOST_IN_CELL + 8], off[STRIP * MOST_IN_CELL + 8], nu_r[STRIP * MOST_IN_CELL + 8];
    double nu_b[STRIP * MOST_IN_CELL + 8], d[STRIP * MOST_IN_CELL + 8], e[STRIP * MOST_IN_CELL + 8];
    int owner[STRIP * MOST_IN_CELL + 8];
} Strip;

IN void numbers(const Tracker *t, const uint64_t *key, Strip *s) {
    for (int m = 0; m < s->cells; m += 8) {
        u8 a, pair, x, y;
        memcpy(&a, s->realisation + m, 64), memcpy(&pair, s->number + m, 64);
        threefry_calls(a, pair << 12, key[0], key[1], &x, &y);
        memcpy(s->x + m, &x, 64), memcpy(s->y + m, &y, 64);
        v8 u = uniform(x), many = full(0), n = full(0);
        for (int j = 0; j < t->shares - 1; j++) {
            n = where_greater(full(t->share[j]), u, full(0), full(1));
            if (total(n) == 0) break;
            many += n;
        }
        for (int l = 0; l < 8; l++) s->many[m + l] = (int)many[l];
    }
}
/* Words of all plots beyond the first of each cell: two a draw. */
IN void further(const uint64_t *key, Strip *s) {
    int n = 0;
    for (int m = 0; m < s->cells; m++) {
        s->from[m] = 2 * n;
        for (int draw = 1; draw <= s->many[m] / 2; draw++) s->again[n] = (s->number[m] << 12) + draw, s->which[n++] = s->realisation[m];
    }
    for (int i = 0; i < n; i += 8) {
        u8 a, pair, x, y;
        memcpy(&a, s->which + i, 64), memcpy(&pair, s->again + i, 64);
        threefry_calls(a, pair, key[0], key[1], &x, &y);
        for (int l = 0; l < 8; l++) s->more[2 * (i + l)] = x[l], s->more[2 * (i + l) + 1] = y[l];
    }
}
/* Plots within the bounds of a gate; then those in it, eight at once. */
IN void false_plots(const Tracker *t, const uint64_t *key, Strip *s, Group *groups) {
    for (int m = s->cells; m < s->cells + 8; m++) s->realisation[m] = s->number[m] = 0;
    numbers(t, key, s), further(key, s);
    int n = 0;
    for (int m = 0; m < s->cells; m++) {
        int i = s->track[m], l = i % 8;
        Group *g = groups + i / 8;
        double least = g->least[l], most = g->most[l], high = g->high[l];
        for (int j = 0; j < s->many[m]; j++) {
            uint64_t word = j ? s->more[s->from[m] + j - 1] : s->y[m];
            double q = s->q[m] + t->dq * ((word >> 32) * 0x1p-32 + 0x1p-33);
            double off = s->b[m] + t->db * ((word & 0xFFFFFFFF) * 0x1p-32 + 0x1p-33);
            s->at_q[n] = q, s->off[n] = off, s->owner[n] = i;
            n += (least <= q) & (q <= most) & (fabs(off) <= high);
        }
    }
    for (int i = n; i < n + 8; i++) s->at_q[i] = s->off[i] = 0, s->owner[i] = 0;
    for (int i = 0; i < n; i += 8) {
        v8 q, nu_b, r, i0, i1, i2;
        memcpy(&q, s->at_q + i, 64), memcpy(&nu_b, s->off + i, 64);
        for (int l = 0; l < 8; l++) {
            Group *g = groups + s->owner[i + l] / 8;
            int at = s->owner[i + l] % 8;
            r[l] = g->r[at], i0[l] = g->I[0][at], i1[l] = g->I[1][at], i2[l] = g->I[2][at];
        }
        v8 nu_r = root(2 * q) - r, d = i0 * nu_r * nu_r + 2 * i1 * nu_r * nu_b + i2 * nu_b * nu_b, e = exponential(-0.5 * d);
        memcpy(s->nu_r + i, &nu_r, 64), memcpy(s->d + i, &d, 64), memcpy(s->e + i, &e, 64);
    }
    for (int i = 0; i < n; i++) {
        if (s->d[i] > t->gate) continue;
        int l = s->owner[i] % 8;
        Group *g = groups + s->owner[i] / 8;
        double nu_r = s->nu_r[i], nu_b = s->off[i], d = s->d[i], e = s->e[i];
        g->count[l] += 1, g->false_count[l] += 1;
        if (d < g->d[l]) g->d[l] = d, g->nu_r[l] = nu_r, g->nu_b[l] = nu_b, g->nearest[l] = 1;
        if (e <= 1e-300) continue;
        g->weight[l] += e, g->bad[l] += e;
        if (!t->joint) continue;
        double share = e / g->weight[l], off_r = nu_r - g->mr[l], off_b = nu_b - g->mb[l];
        g->mr[l] += share * off_r, g->mb[l] += share * off_b;
        g->rr[l] += e * (off_r * (nu_r - g->mr[l])), g->rb[l] += e * (off_r * (nu_b - g->mb[l]));
        g->bb[l] += e * (off_b * (nu_b - g->mb[l]));
    }
    s->cells = 0;
}
IN void look(const Tracker *t, const uint64_t *key, uint64_t first, int k, Group *groups, Strip *s) {
    double middle = 0.5 * t->nb * t->db / (2 * M_PI);
    s->cells = 0;
    for (int i = 0; i < TRACKS; i++) {
        Group *g = groups + i / 8;
        int l = i % 8;
        if (g->state[l] < 0.5) continue;
        double b = g->b[l], high = g->high[l];
        b -= 2 * M_PI * floor((b - t->b0) / (2 * M_PI) - middle + 0.5);
        int i_first = fmin(fmax(floor((g->least[l] - t->q0) / t->dq), 0), t->nq - 1);
        int i_last = fmin(fmax(floor((g->most[l] - t->q0) / t->dq), -1), t->nq - 1);
        int j_first = fmin(fmax(floor((b - high - t->b0) / t->db), 0), t->nb - 1);
        int j_last = fmin(fmax(floor((b + high - t->b0) / t->db), -1), t->nb - 1);
        for (int p = i_first; p <= i_last; p++)
            for (int j = j_first; j <= j_last; j++) {
                int m = s->cells++;
                s->realisation[m] = first + i, s->number[m] = ((uint64_t)k * t->nq + p) * t->nb + j, s->track[m] = i;
                s->q[m] = t->q0 + t->dq * p, s->b[m] = t->b0 + t->db * j - b;
                if (s->cells == STRIP) false_plots(t, key, s, groups);
            }
    }
    false_plots(t, key, s, groups);
}

/* ---- what a track takes, and its update ---- */
typedef struct {
    v8 w, nu_r, nu_b, V[3], wrong, score;
} Taken;
IN Taken associated(const Tracker *t, Group *g) {
    v8 zero = full(0), one = full(1), half = full(0.5), r = larger(g->r, one), size = 2 * M_PI * root(g->det);
    v8 density = t->assumed * r, any = greater(g->count, half);
    double missed = 1 - t->detection * t->inside;
    v8 ratio = missed + t->detection * g->weight / (size * larger(density, 1e-9 * r)), none = density * size * missed / t->detection;
    Taken a = {any, g->nu_r * any, g->nu_b * any, {zero, zero, zero}, g->nearest, logarithm(larger(ratio, full(1e-12)))};
    if (!t->joint) return a;
    v8 sum = none + g->weight, use = where_greater(sum, zero, any * greater(g->n, full(1.5)), zero);
    v8 beta0 = none / where_greater(sum, zero, sum, one), some = 1 - beta0;
    v8 per = where_greater(g->weight, zero, 1 / where_greater(g->weight, zero, g->weight, one), zero);
    a.nu_r = where_greater(use, half, some * g->mr, a.nu_r), a.nu_b = where_greater(use, half, some * g->mb, a.nu_b);
    a.V[0] = use * (beta0 * g->S[0] + some * (g->rr * per + beta0 * (g->mr * g->mr)));
    a.V[1] = use * (beta0 * g->S[1] + some * (g->rb * per + beta0 * (g->mr * g->mb)));
    a.V[2] = use * (beta0 * g->S[2] + some * (g->bb * per + beta0 * (g->mb * g->mb)));
    a.wrong = where_greater(use, half, g->bad * per, a.wrong);
    return a;
}
/* Gain and covariance of a line after a plot: of two plots from the second one on. */
IN void line(v8 *p, v8 *k, v8 n, v8 w, v8 age) {
    v8 later = greater(n, full(1.5)), second = greater(n, full(0.5)), half = full(0.5), per = w / (p[0] + 1), none = full(0);
    v8 rate = where_greater(second, half, 1 / where_greater(second, half, age, full(1)), none);
    k[0] = where_greater(later, half, p[0] * per, w), k[1] = where_greater(later, half, p[1] * per, rate * w);
    v8 p2 = where_greater(later, half, p[2] - k[1] * p[1], where_greater(w, half, 2 * rate * rate, p[2]));
    p[1] = where_greater(later, half, p[1] - k[0] * p[1], where_greater(w, half, rate, p[1]));
    p[0] = where_greater(later, half, p[0] - k[0] * p[0], where_greater(w, half, w, p[0])), p[2] = p2;
}
IN void update(const World *o, const Tracker *t, Group *g, Taken a) {
    v8 rr[2], bb[2], w = a.w, n = g->n, nu_r = a.nu_r, nu_b = a.nu_b;
    double sr = o->sigma[0], sb = o->sigma[1], per = 1 / o->period;
    if (t->joint) {
        v8 *c = g->c, h0 = c[0], h1 = c[1], scale = w / (g->pr[0] + 1), br[2] = {h0 * scale, h1 * scale}, rb[2];
        line(g->pr, rr, n, w, g->age);
        g->pb[0] -= br[0] * h0, g->pb[1] -= br[0] * h1, g->pb[2] -= br[1] * h1;
        c[0] -= rr[0] * h0, c[1] -= rr[0] * h1, c[2] -= rr[1] * h0, c[3] -= rr[1] * h1;
        h0 = c[0], h1 = c[2], scale = w / (g->pb[0] + 1), rb[0] = h0 * scale, rb[1] = h1 * scale;
        line(g->pb, bb, n, w, g->age);
        g->pr[0] -= rb[0] * h0, g->pr[1] -= rb[0] * h1, g->pr[2] -= rb[1] * h1;
        c[0] -= bb[0] * h0, c[2] -= bb[0] * h1, c[1] -= bb[1] * h0, c[3] -= bb[1] * h1;
        v8 V0 = a.V[0] / (sr * sr), V1 = a.V[1] / (sr * sb), V2 = a.V[2] / (sb * sb);
        v8 k[2] = {rr[0] - rb[0] * br[0], rr[1] - rb[1] * br[0]}, l[2] = {br[0] - bb[0] * br[0], br[1] - bb[1] * br[0]};
        v8 u[2] = {V0 * k[0] + V1 * rb[0], V0 * k[1] + V1 * rb[1]}, v[2] = {V1 * k[0] + V2 * rb[0], V1 * k[1] + V2 * rb[1]};
        g->pr[0] += u[0] * k[0] + v[0] * rb[0], g->pr[1] += u[0] * k[1] + v[0] * rb[1], g->pr[2] += u[1] * k[1] + v[1] * rb[1];
        c[0] += u[0] * l[0] + v[0] * bb[0], c[1] += u[0] * l[1] + v[0] * bb[1];
        c[2] += u[1] * l[0] + v[1] * bb[0], c[3] += u[1] * l[1] + v[1] * bb[1];
        u[0] = V0 * l[0] + V1 * bb[0], u[1] = V0 * l[1] + V1 * bb[1], v[0] = V1 * l[0] + V2 * bb[0], v[1] = V1 * l[1] + V2 * bb[1];
        g->pb[0] += u[0] * l[0] + v[0] * bb[0], g->pb[1] += u[0] * l[1] + v[0] * bb[1], g->pb[2] += u[1] * l[1] + v[1] * bb[1];
        nu_b -= sb / sr * br[0] * nu_r;
        g->r += sr / sb * rb[0] * nu_b, g->vr += per * sr / sb * rb[1] * nu_b;
        g->b += sb / sr * br[0] * nu_r, g->vb += per * sb / sr * br[1] * nu_r;
    } else
        line(g->pr, rr, n, w, g->age), line(g->pb, bb, n, w, g->age);
    g->r += rr[0] * nu_r, g->vr += per * rr[1] * nu_r, g->b += bb[0] * nu_b, g->vb += per * bb[1] * nu_b, g->n += w;
}
IN void settle(Group *g, Taken a) {
    v8 half = full(0.5), alive = greater(g->state, half), confirmed = greater(g->state, full(1.5)), got = a.w * alive;
    g->wrong += confirmed * a.wrong, g->taken += confirmed * a.w, g->scans += alive;
    g->score += alive * a.score;
    g->best = where_greater(g->first * alive, half, larger(g->best, g->score), g->best);
    g->hits += got, g->misses = where_greater(got, half, full(0), g->misses + alive);
    g->since = where_greater(got, half, full(0), g->since);
}
IN void begin(Group *g, v8 z_r, v8 z_b, v8 new) {
    v8 half = full(0.5), zero = full(0), one = full(1), *clear[] = {&g->vr, &g->vb, g->pr + 1, g->pr + 2, g->pb + 1, g->pb + 2,
        g->c, g->c + 1, g->c + 2, g->c + 3, &g->misses, &g->since, &g->score, &g->age}, *set[] = {g->pr, g->pb, &g->n, &g->state, &g->scans, &g->hits};
    for (int i = 0; i < 14; i++) *clear[i] = where_greater(new, half, zero, *clear[i]);
    for (int i = 0; i < 6; i++) *set[i] = where_greater(new, half, one, *set[i]);
    g->r = where_greater(new, half, z_r, g->r), g->b = where_greater(new, half, z_b, g->b);
    g->first = where_greater(new, half, where_greater(g->first, -half, zero, one), g->first);
}
/* The next state by the rule m of n and that of misses. */
IN v8 next_state(const Tracker *t, const Group *g) {
    v8 zero = full(0), one = full(1), two = full(2), half = full(0.5), enough = full(t->m - 0.5);
    v8 trying = where_greater(g->hits, enough, two, where_greater(g->hits + t->n - g->scans, enough, one, zero));
    v8 held = where_greater(full(t->most - 0.5), g->misses, two, zero);
    return where_greater(g->state, full(1.5), held, where_greater(g->state, half, trying, zero));
}
IN v8 uncertain(const Tracker *t, const Group *g) { return greater(larger(g->pr[0], g->pb[0]), full(t->lost * t->lost)); }
IN void judge(const World *o, const Tracker *t, Group *g, const double *truth, v8 *counts) {
    v8 half = full(0.5), zero = full(0), most = full(1.5), alive = greater(g->state, half), was = greater(g->state, most);
    v8 now = next_state(t, g), r = g->r - truth[0], b = g->b - truth[3];
    v8 off = where_greater(larger(r, -r), full(t->lost * o->sigma[0]), full(1), greater(larger(b, -b), full(t->lost * o->sigma[1])));
    v8 held = greater(now, most), gone = alive * (1 - greater(now, half));
    v8 lost = held * was * off, vague = held * was * (1 - off) * uncertain(t, g), failed = held * (1 - was) * off;
    counts[LOST] += lost, counts[DROPPED] += vague + gone * was, counts[FAILED] += failed + gone * (1 - was);
    held -= lost + vague + failed;
    v8 trying = greater(now, half) * (1 - greater(now, most)), ended = alive * (1 - held - trying);
    g->state = trying + 2 * held, g->kept = 2 * held, g->held += held;
    counts[KEPT] += held, counts[TRYING] += trying, counts[FOUND] += where_greater(g->before, half, zero, held);
    g->before = where_greater(held, half, held, g->before), g->ends += was * (1 - held);
    g->first = where_greater(ended, half, zero, g->first);
}
IN v8 judge_false(const Tracker *t, Group *g, v8 *begun) {
    v8 half = full(0.5), most = full(1.5), was = greater(g->state, most), now = next_state(t, g);
    now = where_greater(was * uncertain(t, g), half, full(0), now);
    v8 held = greater(now, most);
    begun[0] += greater(now, half) - held, begun[1] += held, begun[2] += held * (1 - was);
    g->state = now;
    return now;
}
IN void scores_of(const Tracker *t, const Group *g, double *scores) {
    v8 least = full(-0.5), zero = full(0);
    for (int j = 0; j <= t->levels; j++) {
        v8 sum = zero, level = full(j < t->levels ? t->threshold[j] : -1e300);
        for (int i = 0; i < GROUPS; i++)
            sum += where_greater(g[i].first, least, where_greater(level, g[i].best, zero, full(1)), zero);
        scores[j] += total(sum);
    }
}
IN void ratio_of(v8 a, v8 b, v8 *s) { s[0] += a, s[1] += a * a, s[2] += b, s[3] += b * b, s[4] += a * b; }
IN void step(const World *o, const Tracker *t, const uint64_t *key, uint64_t first, int k, Group *groups, Strip *strip,
             v8 (*z)[GROUPS], const v8 *w, int begins, v8 *counts) {
    static const v8 none = {0};
    for (int i = 0; i < GROUPS; i++) {
        predict(o, t, groups + i, o->dt[k]);
        open_gates(t, groups + i, z[0][i], z[1][i], w ? w[i] : none, counts);
    }
    if (t->density > 0) look(t, key, first, k, groups, strip);
    for (int i = 0; i < GROUPS; i++) {
        Group *g = groups + i;
        Taken a = associated(t, g);
        counts[FALSE] += greater(g->n, full(1.5)) * greater(g->state, full(0.5)) * g->false_count;
        v8 fresh = begins ? where_greater(g->state, full(0.5), full(0), w[i]) : full(0);
        settle(g, a), update(o, t, g, a), begin(g, z[0][i], z[1][i], fresh);
    }
}
IN void track(const World *o, const Tracker *t, uint64_t first, int count, double *sums, double *counts, double *ratios,
              double *scores) {
    static __thread Group groups[GROUPS];
    static __thread v8 error[2][GROUPS], z[2][GROUPS], w[GROUPS];
    static __thread Strip strip;
    v8 tally[COUNTS], ratio[10] = {0}, s[SUMS];
    for (int done = 0; done < count; done += TRACKS) {
        memset(groups, 0, sizeof groups), memset(error, 0, sizeof error);
        for (int i = 0; i < GROUPS; i++) groups[i].first = full(-1);
        for (int k = 0; k < o->scans; k++) {
            const double *truth = o->truth + 6 * k;
            plots_of(o, first + done, k, error, z, w);
            memset(tally, 0, sizeof tally);
            for (int c = 0; c < 2 && k > 0; c++) {
                memset(s, 0, sizeof s);
                for (int i = 0; i < GROUPS; i++) {
                    v8 x = c ? groups[i].b + o->dt[k] * groups[i].vb : groups[i].r + o->dt[k] * groups[i].vr;
                    powers(x - truth[3 * c], 0.5 * groups[i].kept, s + 25);
                }
                for (int j = 25; j < SUMS; j++) sums[((k - 1) * 2 + c) * SUMS + j] += total(s[j]);
            }
            step(o, t, t->field, first + done, k, groups, &strip, z, w, 1, tally);
            for (int i = 0; i < GROUPS; i++) judge(o, t, groups + i, truth, tally);
            for (int c = 0; c < 2; c++) {
                memset(s, 0, sizeof s);
                for (int i = 0; i < GROUPS; i++) {
                    Group *g = groups + i;
                    v8 zero = full(0), *p = c ? g->pb : g->pr, P[6] = {p[0], p[1], zero, p[2], zero, zero};
                    v8 x[4] = {c ? g->b : g->r, c ? g->vb : g->vr, zero, zero};
                    add(2, x, P, x, 0, truth + 3 * c, g->kept, o->sigma[c], o->period, s);
                }
                for (int j = 0; j < 25; j++) sums[(k * 2 + c) * SUMS + j] += total(s[j]);
            }
            for (int j = 0; j < COUNTS; j++) counts[k * COUNTS + j] += total(tally[j]);
        }
        for (int i = 0; i < GROUPS; i++) {
            ratio_of(groups[i].ends, groups[i].held, ratio), ratio_of(groups[i].wrong, groups[i].taken, ratio + 5);
        }
        scores_of(t, groups, scores);
    }
    for (int j = 0; j < 10; j++) ratios[j] += total(ratio[j]);
}
IN void track_false(const World *o, const Tracker *t, uint64_t first, int count, double *begun, double *scores) {
    static __thread Group groups[GROUPS];
    static __thread v8 z[2][GROUPS];
    static __thread Strip strip;
    u8 lanes = {0, 1, 2, 3, 4, 5, 6, 7};
    v8 ignored[COUNTS];
    for (int done = 0; done < count; done += TRACKS) {
        memset(groups, 0, sizeof groups);
        for (int i = 0; i < GROUPS; i++) {
            u8 x, y;
            threefry(lanes + (first + done + 8 * i), 0, t->seeds[0], t->seeds[1], &x, &y);
            z[0][i] = root(2 * (t->q0 + t->dq * t->nq * uniform(x))), z[1][i] = t->b0 + t->db * t->nb * uniform(y);
            groups[i].first = full(-1);
            begin(groups + i, z[0][i], z[1][i], full(1));
        }
        for (int k = 0; k < o->scans; k++) {
            v8 tally[3] = {0}, left = full(0);
            if (k > 0) step(o, t, t->about, first + done, k, groups, &strip, z, 0, 0, ignored);
            for (int i = 0; i < GROUPS; i++) left += judge_false(t, groups + i, tally);
            for (int j = 0; j < 3; j++) begun[3 * k + j] += total(tally[j]);
            if (total(left) == 0) break;
        }
        scores_of(t, groups, scores);
    }
}

/* sums (K, 2, SUMS), counts (K, COUNTS), begun (K, 3), ratios (2, 5), scores (2, levels + 1). */
void tracked(const World *o, const Tracker *t, uint64_t first, int count, double *sums, double *counts, double *begun,
             double *ratios, double *scores) {
    track(o, t, first, count, sums, counts, ratios, scores);
    if (t->density > 0) track_false(o, t, first, count, begun, scores + t->levels + 1);
}
