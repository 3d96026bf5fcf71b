#include "proto/session_internal.h"

#include <stdio.h>
#include <string.h>

const char *const SESSION_KINDS[EXPOSURE_KINDS] = {"sample", "reference", "dark", "trap", "overlap"};

const char *const SESSION_TABLES[] = {
    "fact",
    "calibration",
    "exposure",
    "exchange_request",
    "exchange",
    "event",
    "linearity",
    "bracket",
    "point",
    "point_band",
    "point_common",
    "estimation",
    "estimation_parameter",
    "estimation_spectrum",
    "estimation_warning",
    "estimation_instrument",
    "estimation_quality",
    "estimation_models",
    "estimation_point",
    "estimation_joint",
    "estimation_joint_row",
    NULL,
};

/* Angles in microdegrees, times in microseconds of the session's clock; bytes are little-endian. */
static const char SCHEMA[] =
    "CREATE TABLE IF NOT EXISTS fact (key TEXT PRIMARY KEY NOT NULL, value TEXT NOT NULL) WITHOUT ROWID;"
    "CREATE TABLE IF NOT EXISTS calibration (id INTEGER PRIMARY KEY CHECK (id = 1), model TEXT, serial TEXT, "
    "pixels "
    "INTEGER,"
    " dark_first INTEGER, dark_last INTEGER, active_first INTEGER, active_last INTEGER, wavelength_0 REAL,"
    " wavelength_1 REAL, wavelength_2 REAL, wavelength_3 REAL, nonlinearity_0 REAL, nonlinearity_1 REAL,"
    " nonlinearity_2 REAL, nonlinearity_3 REAL, nonlinearity_4 REAL, nonlinearity_5 REAL, nonlinearity_6 "
    "REAL,"
    " nonlinearity_7 REAL, nonlinearity_order INTEGER, nonlinearity_used INTEGER, saturation INTEGER,"
    " read_noise_counts REAL, electrons_per_count REAL);"
    "CREATE TABLE IF NOT EXISTS exposure (id INTEGER PRIMARY KEY, step INTEGER NOT NULL, attempt INTEGER NOT "
    "NULL,"
    " kind TEXT NOT NULL, bracket INTEGER NOT NULL, opens INTEGER NOT NULL, control INTEGER NOT NULL, "
    "theta_i_udeg INTEGER NOT NULL,"
    " theta_v_udeg INTEGER NOT NULL, mirrored INTEGER NOT NULL, source_udeg INTEGER NOT NULL,"
    " sample_udeg INTEGER NOT NULL, holder_udeg INTEGER NOT NULL, settled_us INTEGER NOT NULL,"
    " start_us INTEGER NOT NULL, end_us INTEGER NOT NULL, utc_us INTEGER NOT NULL, exposure_us INTEGER NOT "
    "NULL,"
    " n_scans INTEGER NOT NULL, pixels INTEGER NOT NULL, saturated_pixels INTEGER NOT NULL, lamp INTEGER NOT "
    "NULL,"
    " temperature_c REAL, counts BLOB NOT NULL);"
    "CREATE TABLE IF NOT EXISTS exchange_request (id INTEGER PRIMARY KEY, link TEXT NOT NULL, request BLOB "
    "NOT NULL,"
    " UNIQUE (link, request));"
    "CREATE TABLE IF NOT EXISTS exchange (id INTEGER PRIMARY KEY, request_id INTEGER NOT NULL REFERENCES "
    "exchange_request,"
    " sent_us INTEGER NOT NULL, took_us INTEGER NOT NULL, result INTEGER NOT NULL, reply BLOB NOT NULL);"
    "CREATE TABLE IF NOT EXISTS event (id INTEGER PRIMARY KEY, at_us INTEGER NOT NULL, kind TEXT NOT NULL, "
    "json TEXT NOT "
    "NULL);"
    "CREATE TABLE IF NOT EXISTS linearity (id INTEGER PRIMARY KEY, step INTEGER NOT NULL,"
    " long_id INTEGER NOT NULL REFERENCES exposure, short_id INTEGER NOT NULL REFERENCES exposure,"
    " long_us INTEGER NOT NULL, short_us INTEGER NOT NULL, ratio REAL, u_ratio REAL, level_long REAL,"
    " level_short REAL, error_rel REAL, u_error_rel REAL, prior_rel REAL, used_rel REAL, pull REAL,"
    " beyond INTEGER NOT NULL);"
    "CREATE TABLE IF NOT EXISTS bracket (id INTEGER PRIMARY KEY, number INTEGER NOT NULL, open_us INTEGER "
    "NOT NULL,"
    " close_us INTEGER NOT NULL, mean_rate REAL, ended_by TEXT NOT NULL, last_exposure_id INTEGER NOT NULL,"
    " rate BLOB NOT NULL);"
    "CREATE TABLE IF NOT EXISTS point (id INTEGER PRIMARY KEY, supersedes INTEGER UNIQUE REFERENCES point,"
    " provisional INTEGER NOT NULL, exposure_id INTEGER NOT NULL REFERENCES exposure, bracket INTEGER NOT "
    "NULL,"
    " tau_us REAL NOT NULL, tau_r_us REAL NOT NULL, theta_i_udeg INTEGER NOT NULL, theta_v_udeg INTEGER NOT "
    "NULL,"
    " saturated INTEGER NOT NULL, scan_f REAL, noisy INTEGER NOT NULL, mean REAL, mean_u_ind REAL,"
    " mean_u_common REAL);"
    "CREATE TABLE IF NOT EXISTS point_band (point_id INTEGER NOT NULL REFERENCES point, band INTEGER NOT "
    "NULL, beta REAL,"
    " u_ind REAL, u_common REAL, cov_next REAL, PRIMARY KEY (point_id, band)) WITHOUT ROWID;"
    "CREATE TABLE IF NOT EXISTS point_common (point_id INTEGER NOT NULL REFERENCES point, at INTEGER NOT "
    "NULL, name TEXT "
    "NOT NULL,"
    " mean REAL, sensitivity BLOB NOT NULL, PRIMARY KEY (point_id, at)) WITHOUT ROWID;"
    "CREATE TABLE IF NOT EXISTS estimation (id INTEGER PRIMARY KEY, at_us INTEGER NOT NULL, last_point_id "
    "INTEGER NOT NULL,"
    " model TEXT NOT NULL, converged INTEGER NOT NULL, provisional INTEGER NOT NULL, refusal TEXT NOT NULL,"
    " n_points INTEGER NOT NULL, n_parameters INTEGER NOT NULL, kappa REAL, q REAL, mean_low_nm INTEGER,"
    " mean_high_nm INTEGER, chi2 REAL, bic REAL, r2 REAL, median_relative_error REAL, specular_energy REAL,"
    " has_spectrum INTEGER NOT NULL, band_first INTEGER, band_last INTEGER, theta_i_low_deg REAL,"
    " theta_i_high_deg REAL, theta_v_low_deg REAL, theta_v_high_deg REAL, statistical BLOB NOT NULL,"
    " common BLOB NOT NULL);"
    "CREATE TABLE IF NOT EXISTS estimation_parameter (estimation_id INTEGER NOT NULL REFERENCES estimation, "
    "at INTEGER NOT "
    "NULL,"
    " value REAL, u_statistical REAL, u_common REAL, at_bound INTEGER NOT NULL, limit_95 REAL,"
    " not_identifiable INTEGER NOT NULL, why TEXT NOT NULL, next_theta_i_deg REAL, next_theta_v_deg REAL,"
    " PRIMARY KEY (estimation_id, at)) WITHOUT ROWID;"
    "CREATE TABLE IF NOT EXISTS estimation_spectrum (estimation_id INTEGER NOT NULL REFERENCES estimation, "
    "band INTEGER "
    "NOT NULL,"
    " s REAL, u_s REAL, PRIMARY KEY (estimation_id, band)) WITHOUT ROWID;"
    "CREATE TABLE IF NOT EXISTS estimation_warning (estimation_id INTEGER NOT NULL REFERENCES estimation, at "
    "INTEGER NOT "
    "NULL,"
    " text TEXT NOT NULL, PRIMARY KEY (estimation_id, at)) WITHOUT ROWID;"
    "CREATE TABLE IF NOT EXISTS estimation_instrument (estimation_id INTEGER PRIMARY KEY REFERENCES "
    "estimation,"
    " beam_in_view INTEGER NOT NULL, source_width_deg REAL, sensor_width_deg REAL, mirror_offset_deg REAL,"
    " u_mirror_offset_deg REAL, zero_source_deg REAL, zero_sample_deg REAL, polarisation REAL,"
    " u_polarisation REAL, p_limit REAL, n_low REAL, n_high REAL, beta_prime_low REAL, beta_prime_high REAL);"
    "CREATE TABLE IF NOT EXISTS estimation_quality (estimation_id INTEGER PRIMARY KEY REFERENCES estimation,"
    " iterations INTEGER NOT NULL, minimised TEXT NOT NULL, condition REAL, n_effective REAL, loio REAL,"
    " loss_ml REAL, loss_ols REAL, loss_log REAL, loss_cuberoot REAL, loss_cosine REAL);"
    "CREATE TABLE IF NOT EXISTS estimation_models (estimation_id INTEGER PRIMARY KEY REFERENCES estimation,"
    " json TEXT NOT NULL);"
    "CREATE TABLE IF NOT EXISTS estimation_point (estimation_id INTEGER NOT NULL REFERENCES estimation,"
    " point_id INTEGER NOT NULL REFERENCES point, source_per_deg REAL, sample_per_deg REAL,"
    " PRIMARY KEY (estimation_id, point_id)) WITHOUT ROWID;"
    "CREATE TABLE IF NOT EXISTS estimation_joint (estimation_id INTEGER PRIMARY KEY REFERENCES estimation,"
    " model TEXT NOT NULL, converged INTEGER NOT NULL, refusal TEXT NOT NULL, beta_prime_per_band INTEGER "
    "NOT NULL,"
    " misfit INTEGER NOT NULL, n_points INTEGER NOT NULL, n_values INTEGER NOT NULL, n_bands INTEGER NOT "
    "NULL,"
    " kappa REAL, chi2 REAL, chi2_expected REAL, at_bound INTEGER NOT NULL, shared BLOB NOT NULL,"
    " statistical BLOB NOT NULL, common BLOB NOT NULL);"
    "CREATE TABLE IF NOT EXISTS estimation_joint_row (estimation_id INTEGER NOT NULL REFERENCES "
    "estimation_joint,"
    " at INTEGER NOT NULL, parameter TEXT NOT NULL, band INTEGER, value REAL, var_statistical REAL, "
    "var_common REAL,"
    " PRIMARY KEY (estimation_id, at)) WITHOUT ROWID;"
    "CREATE INDEX IF NOT EXISTS point_exposure ON point (exposure_id);";

/* Only points that stand: a provisional one gives way to the final one. */
#define STANDS "NOT EXISTS (SELECT 1 FROM point AS later WHERE later.supersedes = p.id)"
#define PARAMETER(at, what)                                                                                  \
    "(SELECT " what " FROM estimation_parameter WHERE estimation_id = m.id AND at = " #at ")"
/* The total variance; a root would need SQLite's optional mathematics, which R does not build. */
#define VARIANCE "u_statistical * u_statistical + u_common * u_common"
#define COLUMNS(at, name)                                                                                    \
    " " PARAMETER(at, "value") " AS " name ", " PARAMETER(at, VARIANCE) " AS var_" name ", "

static const char VIEWS[] =
    "CREATE VIEW IF NOT EXISTS point_mean AS SELECT p.id AS point_id, p.exposure_id, p.bracket, "
    "p.provisional,"
    " p.theta_i_udeg / 1e6 AS theta_i_deg, p.theta_v_udeg / 1e6 AS theta_v_deg, p.mean AS beta,"
    " p.mean_u_ind AS u_ind, p.mean_u_common AS u_common, p.scan_f, p.noisy FROM point AS p WHERE " STANDS ";"
    "CREATE VIEW IF NOT EXISTS point_spectrum AS SELECT p.id AS point_id, p.exposure_id, p.bracket, "
    "p.provisional,"
    " p.theta_i_udeg / 1e6 AS theta_i_deg, p.theta_v_udeg / 1e6 AS theta_v_deg, 380 + 5 * b.band AS "
    "lambda_nm,"
    " b.beta, b.u_ind, b.u_common FROM point AS p JOIN point_band AS b ON b.point_id = p.id WHERE " STANDS ";"
    "CREATE VIEW IF NOT EXISTS estimate AS SELECT m.id AS estimate_id, m.at_us / 1e6 AS at_s, "
    "m.last_point_id, m.model,"
    " m.converged, m.provisional, m.n_points," COLUMNS(0, "S") COLUMNS(1, "sigma") COLUMNS(2, "gamma")
        COLUMNS(3, "beta_prime") COLUMNS(4, "n") COLUMNS(5, "extra_1") COLUMNS(
            6, "extra_2") " m.kappa, m.q, m.chi2, m.bic, m.r2, m.median_relative_error, "
                          "m.specular_energy, m.refusal FROM estimation AS m;"
                          "CREATE VIEW IF NOT EXISTS estimate_spectrum AS SELECT s.estimation_id AS "
                          "estimate_id, "
                          "380 + 5 * s.band AS lambda_nm, s.s AS S,"
                          " s.u_s AS u_S FROM estimation_spectrum AS s;"
                          "CREATE VIEW IF NOT EXISTS estimate_joint AS SELECT estimation_id AS estimate_id, "
                          "parameter,"
                          " 380 + 5 * band AS lambda_nm, value, var_statistical + var_common AS var FROM"
                          " estimation_joint_row;"
                          "CREATE VIEW IF NOT EXISTS exchange_log AS SELECT x.id AS exchange_id, r.link, "
                          "x.sent_us, x.sent_us + x.took_us AS done_us,"
                          " x.result, hex(r.request) AS request, hex(x.reply) AS reply FROM exchange "
                          "AS x JOIN exchange_request AS r"
                          " ON r.id = x.request_id;";

/* The last column of every table: the checksum of the row's other values, its `id` apart. NULL in rows of before there
 * were any. */
static int add_checksum(struct store *store, const char *table, struct err *e) {
    char sql[120];
    int64_t there = 0;
    snprintf(sql, sizeof sql, "SELECT count(*) FROM pragma_table_info('%s') WHERE name = 'crc'", table);
    int rc = store_number(store, sql, 0, &there, e);
    snprintf(sql, sizeof sql, "ALTER TABLE %s ADD COLUMN crc INTEGER", table);
    return rc == 0 && !there ? store_exec(store, sql, e) : rc;
}

static int guard(struct store *store, const char *table, struct err *e) {
    char sql[440];
    snprintf(sql, sizeof sql,
             "CREATE TRIGGER IF NOT EXISTS %s_no_update BEFORE UPDATE ON %s BEGIN SELECT RAISE(ABORT, '%s is "
             "insert-only'); END;"
             "CREATE TRIGGER IF NOT EXISTS %s_no_delete BEFORE DELETE ON %s BEGIN SELECT RAISE(ABORT, '%s is "
             "insert-only'); "
             "END;",
             table, table, table, table, table, table);
    return store_exec(store, sql, e);
}

/* Also brings the file of an older goniod up to date: what is there already stays as it is. */
int session_make_schema(struct store *store, struct err *e) {
    char version[80];
    snprintf(version, sizeof version, "PRAGMA application_id = %d; PRAGMA user_version = %d",
             SESSION_APPLICATION_ID, SESSION_USER_VERSION);
    int rc = store_exec(store, "BEGIN IMMEDIATE", e);
    if (rc == 0)
        rc = store_exec(store, SCHEMA, e);
    if (rc == 0)
        rc = store_exec(store, VIEWS, e);
    for (int i = 0; rc == 0 && SESSION_TABLES[i]; i++) {
        rc = add_checksum(store, SESSION_TABLES[i], e);
        if (rc == 0)
            rc = guard(store, SESSION_TABLES[i], e);
    }
    if (rc == 0)
        rc = store_exec(store, version, e);
    if (rc == 0)
        rc = store_exec(store, "COMMIT", e);
    return rc;
}
