/* Surrogate "levenberg", trained on full 1.1.0. Written by castblast 0.1.0.
 *
 * C99, no dependency beyond libm, no allocation, no state that changes: safe from any thread.
 * All quantities are in SI units, angles in radians. An answer holds only for the simulator that
 * the surrogate was trained on, and only where `domain` is CASTBLAST_INSIDE. It has two bands:
 *
 *   prediction  5th to 95th percentile of the blast itself; prior: not calibrated on your blasts
 *   network     95 % of what the simulator would give; no statement about a blast
 *
 *     double inputs[CASTBLAST_INPUTS];
 *     castblast_prediction answer;
 *     inputs[CASTBLAST_UCS] = 100000000.0;  Pa
 *     inputs[CASTBLAST_YOUNG_MODULUS] = 20000000000.0;  Pa
 *     inputs[CASTBLAST_POISSON_RATIO] = 0.25;  1
 *     inputs[CASTBLAST_ROCK_DENSITY] = 2600.0;  kg m-3
 *     inputs[CASTBLAST_FRICTION_ANGLE] = 0.7853981633974483;  rad
 *     inputs[CASTBLAST_DILATION_ANGLE] = 0.0;  rad
 *     inputs[CASTBLAST_TENSILE_STRENGTH] = 0.0;  Pa
 *     inputs[CASTBLAST_IN_SITU_STRESS] = 0.0;  Pa
 *     inputs[CASTBLAST_HOLE_DIAMETER] = 0.15;  m
 *     inputs[CASTBLAST_BURDEN] = 3.0;  m
 *     inputs[CASTBLAST_SPACING] = 3.0;  m
 *     inputs[CASTBLAST_BENCH_HEIGHT] = 12.5;  m
 *     inputs[CASTBLAST_FACE_ANGLE] = 1.5707963267948966;  rad
 *     inputs[CASTBLAST_STEMMING_LENGTH] = 2.0999999999999996;  m
 *     if (castblast_predict(CASTBLAST_EXPLOSIVE_ANFO, inputs, &answer) == 0) { ... }
 */
#ifndef CASTBLAST_MODEL_H
#define CASTBLAST_MODEL_H

#ifdef __cplusplus
extern "C" {
#endif

#define CASTBLAST_INPUTS 14
#define CASTBLAST_OUTPUTS 4
#define CASTBLAST_EXPLOSIVES 4

/* Positions in `inputs`; the training range is in castblast_lower and castblast_upper. */
enum {
  CASTBLAST_UCS = 0, /* [Pa] uniaxial compressive strength */
  CASTBLAST_YOUNG_MODULUS = 1, /* [Pa] Young_s modulus */
  CASTBLAST_POISSON_RATIO = 2, /* [1] Poisson_s ratio */
  CASTBLAST_ROCK_DENSITY = 3, /* [kg m-3] rock density */
  CASTBLAST_FRICTION_ANGLE = 4, /* [rad] internal friction angle */
  CASTBLAST_DILATION_ANGLE = 5, /* [rad] dilation angle */
  CASTBLAST_TENSILE_STRENGTH = 6, /* [Pa] tensile strength */
  CASTBLAST_IN_SITU_STRESS = 7, /* [Pa] isotropic in-situ compression */
  CASTBLAST_HOLE_DIAMETER = 8, /* [m] blasthole diameter */
  CASTBLAST_BURDEN = 9, /* [m] burden at the crest */
  CASTBLAST_SPACING = 10, /* [m] hole spacing */
  CASTBLAST_BENCH_HEIGHT = 11, /* [m] bench height */
  CASTBLAST_FACE_ANGLE = 12, /* [rad] bench face angle */
  CASTBLAST_STEMMING_LENGTH = 13 /* [m] stemming length */
};

/* Positions in `value` and in the ends of the bands of an answer. */
enum {
  CASTBLAST_EQUILIBRIUM_PRESSURE = 0, /* [Pa] gas pressure when the hole has come to rest */
  CASTBLAST_BURDEN_VELOCITY = 1, /* [m s-1] final velocity of the burden */
  CASTBLAST_CRUSHED_ZONE_RADIUS = 2, /* [m] initial radius inside which the plastic shear strain is at least 1 percent */
  CASTBLAST_EXPANDED_HOLE_RADIUS = 3 /* [m] hole radius after expansion */
};

enum {
  CASTBLAST_EXPLOSIVE_ANFO = 0,
  CASTBLAST_EXPLOSIVE_DOPED_EMULSION = 1,
  CASTBLAST_EXPLOSIVE_GASSED_EMULSION = 2,
  CASTBLAST_EXPLOSIVE_HEAVY_ANFO = 3
};

enum {
  CASTBLAST_INSIDE = 0,  /* ranges, rules and joint density kept */
  CASTBLAST_UNUSUAL = 1, /* ranges and rules kept, the combination is unusual */
  CASTBLAST_OUTSIDE = 2  /* a range or a rule is broken, or an input is not a number */
};

extern const char *const castblast_explosive_names[CASTBLAST_EXPLOSIVES];
extern const char *const castblast_input_names[CASTBLAST_INPUTS];
extern const char *const castblast_input_units[CASTBLAST_INPUTS];
extern const double castblast_lower[CASTBLAST_INPUTS];
extern const double castblast_upper[CASTBLAST_INPUTS];
extern const char *const castblast_output_names[CASTBLAST_OUTPUTS];
extern const char *const castblast_output_units[CASTBLAST_OUTPUTS];

typedef struct {
  double value[CASTBLAST_OUTPUTS];
  double prediction_lower[CASTBLAST_OUTPUTS]; /* where the blast is expected; NaN: not stated */
  double prediction_upper[CASTBLAST_OUTPUTS];
  double network_lower[CASTBLAST_OUTPUTS]; /* where the simulator is expected */
  double network_upper[CASTBLAST_OUTPUTS]; /* both meant for rows inside the domain */
  double score;                          /* joint density, at most 1 inside; NaN: not known */
  int in_domain;                         /* 1: inside, 0: do not use the values as they are */
  int domain;                            /* CASTBLAST_INSIDE, _UNUSUAL or _OUTSIDE */
  int offending[CASTBLAST_INPUTS];       /* 1: this input takes part in what is broken */
} castblast_prediction;

/* Position of an explosive, -1 if this surrogate does not know it. */
int castblast_explosive(const char *name);

/* Predict one design. Returns 0, or -1 for an unknown explosive (`answer` is then all NaN). */
int castblast_predict(int explosive, const double inputs[CASTBLAST_INPUTS],
                      castblast_prediction *answer);

#ifdef __cplusplus
}
#endif

#endif
