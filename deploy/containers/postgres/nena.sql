-- Run once by the PostgreSQL image, when it creates the database: the services' user owns its database but is not a
-- superuser, and the superuser has no password, so that it can log in only from within the container.
\getenv password POSTGRES_PASSWORD
CREATE ROLE nena LOGIN PASSWORD :'password';
CREATE DATABASE nena OWNER nena;
REVOKE CONNECT ON DATABASE nena FROM PUBLIC;
ALTER ROLE CURRENT_USER PASSWORD NULL;
