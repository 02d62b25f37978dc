#include "server/store/schema.h"

namespace lightloom {
namespace {

constexpr std::string_view kMigrations[] = {
    // Version 1. `segment`, `offset` and `length` say where a result's payload lies, and are NULL once a checkpoint holds it.
    R"sql(
CREATE TABLE job (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,
    request_id TEXT NOT NULL,
    created_at TEXT NOT NULL,
    submitted BLOB NOT NULL,
    label BLOB NOT NULL,
    scene TEXT NOT NULL,
    state TEXT NOT NULL,
    message TEXT NOT NULL DEFAULT '',
    spec BLOB,
    final BLOB
);
CREATE TABLE event (
    job INTEGER NOT NULL REFERENCES job ON DELETE CASCADE,
    number INTEGER NOT NULL,
    kind TEXT NOT NULL,
    bytes BLOB NOT NULL,
    PRIMARY KEY (job, number)
) WITHOUT ROWID;
CREATE TABLE worker (
    job INTEGER NOT NULL REFERENCES job ON DELETE CASCADE,
    number INTEGER NOT NULL,
    bytes BLOB NOT NULL,
    PRIMARY KEY (job, number)
) WITHOUT ROWID;
CREATE TABLE result (
    job INTEGER NOT NULL REFERENCES job ON DELETE CASCADE,
    kind INTEGER NOT NULL,
    round INTEGER NOT NULL,
    unit_group INTEGER NOT NULL,
    tile INTEGER NOT NULL,
    digest BLOB NOT NULL,
    worker INTEGER NOT NULL,
    seconds REAL NOT NULL,
    segment INTEGER,
    offset INTEGER,
    length INTEGER,
    PRIMARY KEY (job, kind, round, unit_group, tile)
) WITHOUT ROWID;
CREATE TABLE checkpoint (
    job INTEGER PRIMARY KEY REFERENCES job ON DELETE CASCADE,
    groups INTEGER NOT NULL,
    file TEXT NOT NULL,
    digest BLOB NOT NULL,
    size INTEGER NOT NULL
);
)sql",
};

}  // namespace

std::span<const std::string_view> store_migrations() { return kMigrations; }

}  // namespace lightloom
