/*
 * ciede2000.h — how different two colours look: CIEDE2000 with kL = kC = kH = 1, in units of one just visible step.
 *
 * Symmetric; 0 for equal colours. Any finite Lab.
 * Source     ISO/CIE 11664-6:2014, in the form of Sharma, Wu and Dalal, Color Res. Appl. 30, 21 (2005).
 * Checked    tests/unit/test_ciede2000.c: the 34 pairs of that paper
 */
#ifndef FIT_RENDER_CIEDE2000_H
#define FIT_RENDER_CIEDE2000_H

double ciede2000(const double lab_1[3], const double lab_2[3]);

#endif
