#include "daemon/configuration.h"

#include "daemon/config.h"
#include "daemon/job.h"

void configuration_print(FILE *out) {
    fputs("# Keys of goniod.yaml and job.yaml\n\n"
          "Printed from the tables that read the files, so it is complete. A key that is not listed is a "
          "mistake, "
          "and so is\na value outside its range: every mistake of a file is reported at once, with line and "
          "column. "
          "Angles are in degrees.\nExamples with comments: [goniod.yaml](examples/goniod.yaml), "
          "[job.yaml](examples/job.yaml), and a\n[certificate](examples/certificate.csv) of a reference "
          "diffuser.\n\n",
          out);
    config_print_reference(out);
    job_print_reference(out);
}
