/* What the processor can do. */

#if defined(__x86_64__)
#include <cpuid.h>

/* Whether the processor and the system know AVX2. */
int brachis_has_avx2(void)
{
    unsigned a, b, c, d;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE) || !(c & bit_AVX)) {
        return 0;
    }
    unsigned low, high;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    if ((low & 6) != 6 || !__get_cpuid_count(7, 0, &a, &b, &c, &d)) {
        return 0;
    }
    return (b & bit_AVX2) != 0;
}
#else
int brachis_has_avx2(void)
{
    return 0;
}
#endif

/* Digest of the source that this library was made of. */
const char *brachis_source(void)
{
    return SOURCE;
}
