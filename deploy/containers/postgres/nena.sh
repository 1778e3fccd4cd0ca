#!/bin/sh
# Run once by the image of PostgreSQL, when it makes an empty database: the services' user owns a database and is no
# superuser, and the superuser has no password, so that it logs in from within the container only.
set -eu
psql --set ON_ERROR_STOP=1 --set "password=$POSTGRES_PASSWORD" --username "$POSTGRES_USER" --dbname postgres --no-password <<'SQL'
CREATE ROLE nena LOGIN PASSWORD :'password';
CREATE DATABASE nena OWNER nena;
REVOKE CONNECT ON DATABASE nena FROM PUBLIC;
ALTER ROLE CURRENT_USER PASSWORD NULL;
SQL
