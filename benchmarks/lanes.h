/* Eight numbers at once and the project's noise by counter, for the C limits: what radarsim/kernels/lanes.py and
   radarsim/kernels/random.py do, with the same constants, so that results are equal to rounding. */
#include <math.h>
#include <stdint.h>
#ifdef __AVX512F__
#include <immintrin.h>
#endif

typedef double v8 __attribute__((vector_size(64)));
typedef int64_t i8 __attribute__((vector_size(64)));
typedef uint64_t u8 __attribute__((vector_size(64)));
#define IN static inline __attribute__((always_inline))

IN v8 full(double x) { return (v8){x, x, x, x, x, x, x, x}; }
IN v8 where_greater(v8 x, v8 y, v8 yes, v8 no) {
#ifdef __AVX512F__
    __mmask8 m = _mm512_cmp_pd_mask((__m512d)x, (__m512d)y, _CMP_GT_OQ);
    return (v8)_mm512_mask_blend_pd(m, (__m512d)no, (__m512d)yes);
#else
    i8 m = x > y;
    return (v8)((m & (i8)yes) | (~m & (i8)no));
#endif
}
IN v8 root(v8 x) {
    v8 y;
    for (int i = 0; i < 8; i++) y[i] = sqrt(x[i]);
    return y;
}
IN double total(v8 x) { return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7])); }

IN u8 rotated(u8 x, int n) { return (x << n) | (x >> (64 - n)); }
#define ROUND(n) a += b, b = rotated(b, n) ^ a
#define ROUNDS(i, j, k, l, s, t, add) ROUND(i), ROUND(j), ROUND(k), ROUND(l), a += s, b += t + add
IN void threefry_calls(u8 a, u8 call, uint64_t k0, uint64_t k1, u8 *x, u8 *y) {
    uint64_t k2 = 0x1BD11BDAA9FC1A22u ^ k0 ^ k1;
    u8 b = call + k1;
    a += k0;
    ROUNDS(16, 42, 12, 31, k1, k2, 1);
    ROUNDS(16, 32, 24, 21, k2, k0, 2);
    ROUNDS(16, 42, 12, 31, k0, k1, 3);
    ROUND(16);
    *x = a, *y = b;
}
IN void threefry(u8 a, uint64_t call, uint64_t k0, uint64_t k1, u8 *x, u8 *y) {
    threefry_calls(a, (u8){0} + call, k0, k1, x, y);
}
IN v8 logarithm(v8 x) {
    i8 b = (i8)x, e = (b - 0x3FE6A09E667F3BCD) >> 52;
    v8 m = (v8)(b - (e << 52)), s = (m - 1.0) / (m + 1.0), q = s * s;
    v8 p = q * 0.1479594981044202 + 0.15314050542046614;
    p = p * q + 0.1818356432645527, p = p * q + 0.2222219857317996, p = p * q + 0.28571428742387633;
    p = p * q + 0.39999999999414676, p = p * q + 0.6666666666666734;
    return __builtin_convertvector(e, v8) * 0.69314718055994531 + s * (p * q + 2.0);
}
IN v8 uniform(u8 x) { return __builtin_convertvector(x >> 12, v8) * 0x1p-52 + 0x1p-53; }
IN void normals(u8 realisation, uint64_t pair, const uint64_t *key, v8 *one, v8 *two) {
    u8 x, y;
    threefry(realisation, pair >> 1, key[0], key[1], &x, &y);
    x = pair & 1 ? y : x, y = x * 0x9E3779B97F4A7C15u;
    v8 r = root(-2.0 * logarithm(__builtin_convertvector(x, v8) * 0x1p-64 + 0x1p-65));
    v8 t = __builtin_convertvector((i8)y, v8) * (M_PI / 2 * 0x1p-64), q = t * t;
    v8 s = q * 1.589623019235577e-10 - 2.505074776349835e-08, c = q * 2.0645119015439733e-09 - 2.7555523111876013e-07;
    s = s * q + 2.7557313621390157e-06, s = s * q - 0.00019841269829589552;
    s = s * q + 0.008333333333322118, s = s * q - 0.1666666666666663;
    c = c * q + 2.48015807073305e-05, c = c * q - 0.0013888888877611812, c = c * q + 0.04166666666659654;
    s = t * q * s + t, c = (c * q - 0.5) * q + 1.0;
    i8 turned = -(i8)(y & 1);
    r = (v8)((u8)r ^ ((y & 2) << 62));
    *one = r * (v8)((turned & (i8)s) | (~turned & (i8)c)), *two = r * (v8)((turned & (i8)c) | (~turned & (i8)s));
}
