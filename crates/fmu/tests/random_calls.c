/* Random calls of the functions of FMI in any order, with valid, null and invalid arguments: exit status 0 if none returns
 * fmi2Fatal and each fmi2Error has a message.
 *
 *     random_calls LIBRARY GUID RESOURCES SEED CALLS
 *
 * Memory errors and leaks are found by the sanitizers that interface.rs compiles it with. */
#include <dlfcn.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef void *Component;
typedef void *State;
typedef unsigned int Reference;
typedef struct {
  void (*logger)(void *, const char *, int, const char *, const char *, ...);
  void *(*allocate)(size_t, size_t);
  void (*release)(void *);
  void (*finished)(void *, int);
  void *environment;
} Callbacks;

#define SLOTS 3
#define MOST 8

static uint64_t seed;
static long messages;

/* xorshift64* */
static uint64_t next(void) {
  seed ^= seed >> 12;
  seed ^= seed << 25;
  seed ^= seed >> 27;
  return seed * 0x2545F4914F6CDD1DULL;
}

static size_t below(size_t count) { return (size_t)(next() >> 33) % count; }

static double number(void) {
  static const double special[] = {0, -0.0, 1e-310, 1e308, -1e308, NAN, INFINITY, -INFINITY, 1e-3, 0.5};
  return below(4) ? (double)(int64_t)next() * 1e-21 : special[below(sizeof special / sizeof *special)];
}

static const char *word(void) {
  static const char *const words[] = {"gpc", "cascade", "rst", "", "x", "2.5", "[1, 2]", "\xff\xfe", "%s%n", "a: {b: ["};
  size_t index = below(sizeof words / sizeof *words + 1);
  return index ? words[index - 1] : NULL;
}

static void logger(void *environment, const char *name, int status, const char *category, const char *message, ...) {
  if (environment != &messages || !strlen(name) || !strlen(category) || !strlen(message) || status < 1) abort();
  messages++;
}

static void *library;

static void *function(const char *name) {
  void *found = dlsym(library, name);
  if (!found) {
    fprintf(stderr, "%s is missing\n", name);
    exit(2);
  }
  return found;
}

/* A pointer to a function from one to an object, as POSIX guarantees. */
#define LOAD(name) *(void **)&name = function(#name)

int main(int count, char **arguments) {
  if (count != 6) return 2;
  library = dlopen(arguments[1], RTLD_NOW);
  if (!library) return 2;
  const char *guid = arguments[2], *resources = arguments[3];
  seed = strtoull(arguments[4], NULL, 10) * 2 + 1;
  long calls = strtol(arguments[5], NULL, 10), tally[4] = {0};
  Component (*fmi2Instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
  void (*fmi2FreeInstance)(Component);
  int (*fmi2SetupExperiment)(Component, int, double, double, int, double);
  int (*fmi2EnterInitializationMode)(Component), (*fmi2ExitInitializationMode)(Component);
  int (*fmi2Terminate)(Component), (*fmi2Reset)(Component), (*fmi2CancelStep)(Component);
  int (*fmi2GetReal)(Component, const Reference *, size_t, double *);
  int (*fmi2SetReal)(Component, const Reference *, size_t, const double *);
  int (*fmi2GetInteger)(Component, const Reference *, size_t, int *);
  int (*fmi2SetInteger)(Component, const Reference *, size_t, const int *);
  int (*fmi2GetBoolean)(Component, const Reference *, size_t, int *);
  int (*fmi2SetBoolean)(Component, const Reference *, size_t, const int *);
  int (*fmi2GetString)(Component, const Reference *, size_t, const char **);
  int (*fmi2SetString)(Component, const Reference *, size_t, const char *const *);
  int (*fmi2DoStep)(Component, double, double, int);
  int (*fmi2GetRealStatus)(Component, int, double *);
  int (*fmi2GetFMUstate)(Component, State *), (*fmi2SetFMUstate)(Component, State);
  int (*fmi2FreeFMUstate)(Component, State *);
  int (*fmi2SerializedFMUstateSize)(Component, State, size_t *);
  int (*fmi2SerializeFMUstate)(Component, State, char *, size_t);
  int (*fmi2DeSerializeFMUstate)(Component, const char *, size_t, State *);
  LOAD(fmi2Instantiate), LOAD(fmi2FreeInstance), LOAD(fmi2SetupExperiment), LOAD(fmi2EnterInitializationMode);
  LOAD(fmi2ExitInitializationMode), LOAD(fmi2Terminate), LOAD(fmi2Reset), LOAD(fmi2CancelStep), LOAD(fmi2GetReal);
  LOAD(fmi2SetReal), LOAD(fmi2GetInteger), LOAD(fmi2SetInteger), LOAD(fmi2GetBoolean), LOAD(fmi2SetBoolean);
  LOAD(fmi2GetString), LOAD(fmi2SetString), LOAD(fmi2DoStep), LOAD(fmi2GetRealStatus), LOAD(fmi2GetFMUstate);
  LOAD(fmi2SetFMUstate), LOAD(fmi2FreeFMUstate), LOAD(fmi2SerializedFMUstateSize), LOAD(fmi2SerializeFMUstate);
  LOAD(fmi2DeSerializeFMUstate);
  static const char *const others[] = {"fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2SetDebugLogging",
      "fmi2GetDirectionalDerivative", "fmi2SetRealInputDerivatives", "fmi2GetRealOutputDerivatives", "fmi2GetStatus",
      "fmi2GetIntegerStatus", "fmi2GetBooleanStatus", "fmi2GetStringStatus"};
  for (size_t k = 0; k < sizeof others / sizeof *others; k++) function(others[k]);

  const Callbacks callbacks = {.logger = logger, .environment = &messages};
  Component instances[SLOTS] = {0};
  State states[SLOTS] = {0};
  long steps = 0;
  for (long call = 0; call < calls; call++) {
    size_t slot = below(SLOTS);
    Component *c = &instances[slot];
    State *state = &states[below(20) ? slot : below(SLOTS)];
    Reference references[MOST];
    double reals[MOST];
    int integers[MOST];
    const char *texts[MOST];
    size_t length = below(MOST);
    for (size_t k = 0; k < MOST; k++) {
      references[k] = (Reference)(below(40) ? below(300) : next());
      reals[k] = below(4) ? fmod((double)(int64_t)next() * 1e-21, 0.01) : number();
      integers[k] = below(4) ? (int)below(20) : (int)next();
      texts[k] = word();
    }
    /* Setpoints and loads of the five axes alone, in half of the calls. */
    if (below(2)) for (size_t k = 0; k < MOST; k++) references[k] = (Reference)below(10), reals[k] = isfinite(reals[k]) ? fmod(reals[k], 0.01) : 0;
    const Reference *vr = below(15) ? references : NULL;
    double *real = below(15) ? reals : NULL, time = 0;
    int status = 0;
    long before = messages;
    switch (below(26)) {
      case 0:
      case 1:
        if (*c) break;
        *c = fmi2Instantiate(below(9) ? "axes" : NULL, below(9) ? 1 : 0, below(9) ? guid : word(),
                             below(9) ? resources : word(), &callbacks, 0, 0);
        if (!*c && messages == before) return 1;
        break;
      case 2:
        if (!below(12)) fmi2FreeInstance(*c), *c = NULL, states[slot] = NULL;
        break;
      case 3:
        status = fmi2SetupExperiment(*c, 0, 0, below(4) ? 0 : number(), 0, 0);
        break;
      case 4:
        status = fmi2EnterInitializationMode(*c);
        break;
      case 5:
        status = fmi2ExitInitializationMode(*c);
        break;
      case 6:
        status = below(30) ? 0 : fmi2Terminate(*c);
        break;
      case 7:
        status = below(30) ? 0 : fmi2Reset(*c);
        break;
      case 8:
      case 9:
      case 10:
      case 11:
      case 12:
        status = fmi2GetRealStatus(*c, 2, &time);
        if (status == 0) {
          status = fmi2DoStep(*c, below(9) ? time : number(), below(9) ? 125e-6 * (double)(1 + below(100)) : number(), 0);
          steps += status == 0;
        }
        break;
      case 13:
        status = fmi2GetReal(*c, vr, length, real);
        break;
      case 14:
      case 15:
        status = fmi2SetReal(*c, vr, below(9) ? length % 2 : length, real);
        break;
      case 16:
        status = fmi2GetInteger(*c, vr, length % 2, integers);
        break;
      case 17:
        status = fmi2SetInteger(*c, vr, length % 2, integers);
        break;
      case 18:
        status = below(2) ? fmi2GetBoolean(*c, vr, length % 2, integers) : fmi2SetBoolean(*c, vr, length % 2, integers);
        break;
      case 19:
        status = fmi2GetString(*c, vr, length % 2, texts);
        if (status == 0 && length % 2 && !texts[0]) return 1;
        break;
      case 20:
        status = fmi2SetString(*c, vr, length % 2, texts);
        break;
      case 21:
        status = fmi2GetFMUstate(*c, below(15) ? state : NULL);
        break;
      case 22:
        status = fmi2SetFMUstate(*c, below(15) ? *state : (State)(uintptr_t)next());
        break;
      case 23:
        status = below(3) ? 0 : fmi2FreeFMUstate(*c, state);
        break;
      case 24: {
        /* A state through bytes, often damaged. */
        size_t size = 0;
        status = fmi2SerializedFMUstateSize(*c, *state, &size);
        if (status != 0) break;
        char *bytes = malloc(size);
        status = fmi2SerializeFMUstate(*c, *state, bytes, below(9) ? size : below(size));
        if (below(3) == 0) bytes[below(size)] ^= (char)(1 << below(8));
        State read = NULL;
        if (status == 0) status = fmi2DeSerializeFMUstate(*c, bytes, below(3) ? size : below(size), &read);
        if (status == 0) status = fmi2SetFMUstate(*c, read);
        if (read && fmi2FreeFMUstate(*c, &read)) return 1;
        free(bytes);
        break;
      }
      case 25:
        status = fmi2CancelStep(*c);
        break;
    }
    if (status < 0 || status > 3 || (status == 3 && *c && messages == before)) {
      fprintf(stderr, "call %ld: status %d, %ld messages\n", call, status, messages - before);
      return 1;
    }
    tally[status]++;
  }
  for (int slot = 0; slot < SLOTS; slot++) fmi2FreeInstance(instances[slot]);
  printf("%ld steps, %ld ok, %ld errors\n", steps, tally[0], tally[3]);
  return 0;
}
