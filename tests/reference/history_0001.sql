BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0001');
CREATE TABLE decision (
	entry_id INTEGER NOT NULL, 
	machine_id INTEGER NOT NULL, 
	alarm VARCHAR(40) NOT NULL, 
	action VARCHAR(20) NOT NULL, 
	until VARCHAR(10), 
	owner VARCHAR(200) NOT NULL, 
	note TEXT NOT NULL, 
	utc VARCHAR(32) NOT NULL, 
	PRIMARY KEY (entry_id), 
	FOREIGN KEY(entry_id) REFERENCES entry (id), 
	FOREIGN KEY(machine_id) REFERENCES machine (id)
);
INSERT INTO "decision" VALUES(3,1,'2026-10-02-1','accept',NULL,'Ann','','2026-10-02T08:00:00Z');
CREATE TABLE entry (
	id INTEGER NOT NULL, 
	machine_id INTEGER NOT NULL, 
	number INTEGER NOT NULL, 
	kind VARCHAR(20) NOT NULL, 
	utc VARCHAR(32) NOT NULL, 
	content VARCHAR(64) NOT NULL, 
	previous VARCHAR(64) NOT NULL, 
	hash VARCHAR(64) NOT NULL, 
	PRIMARY KEY (id), 
	CONSTRAINT uq_entry_machine_id UNIQUE (machine_id, number), 
	FOREIGN KEY(machine_id) REFERENCES machine (id)
);
INSERT INTO "entry" VALUES(1,1,1,'night','2026-10-01T02:04:00Z','a09b6c48865db998297736453e4110fa9284de6ab2a0fbe7485fb72c69524e45','0000000000000000000000000000000000000000000000000000000000000000','67dfe4f1dd4f6984d8bcbbf36ce640a01576e4554f0edbf64e90b32ae8242f7f');
INSERT INTO "entry" VALUES(2,1,2,'night','2026-10-02T02:04:00Z','e323622f0e72c582c4e0b1de35a3c1edb1d7045e0b52b833376405c414538d59','67dfe4f1dd4f6984d8bcbbf36ce640a01576e4554f0edbf64e90b32ae8242f7f','b05b5bfb2b7e9ed2d65f29f08f4a078e4d2299f165eb372728ff418226ff13cb');
INSERT INTO "entry" VALUES(3,1,3,'decision','2026-10-02T08:00:00Z','6ac250fdfa983714f4d03c9b41240c504c5c35cc8ee057f7e0d810ddf566e1a4','b05b5bfb2b7e9ed2d65f29f08f4a078e4d2299f165eb372728ff418226ff13cb','7451a21d618ef80e6c7118f69c4a6b429eca6179f6f11da2d0112b3e3c469fac');
CREATE TABLE machine (
	id INTEGER NOT NULL, 
	name VARCHAR(200) NOT NULL, 
	cell TEXT NOT NULL, 
	added_utc VARCHAR(32) NOT NULL, 
	PRIMARY KEY (id), 
	UNIQUE (name)
);
INSERT INTO "machine" VALUES(1,'M','/cells/m','2026-10-01T02:04:00Z');
CREATE TABLE night (
	entry_id INTEGER NOT NULL, 
	machine_id INTEGER NOT NULL, 
	night VARCHAR(10) NOT NULL, 
	start_utc VARCHAR(32) NOT NULL, 
	end_utc VARCHAR(32) NOT NULL, 
	kind VARCHAR(20) NOT NULL, 
	status VARCHAR(20) NOT NULL, 
	verdict VARCHAR(20) NOT NULL, 
	headline TEXT NOT NULL, 
	alarms INTEGER NOT NULL, 
	p_value FLOAT, 
	touches INTEGER NOT NULL, 
	rms_um FLOAT, 
	volume_um FLOAT, 
	duration_s FLOAT NOT NULL, 
	PRIMARY KEY (entry_id), 
	FOREIGN KEY(entry_id) REFERENCES entry (id), 
	FOREIGN KEY(machine_id) REFERENCES machine (id)
);
INSERT INTO "night" VALUES(1,1,'2026-10-01','2026-10-01T02:00:00Z','2026-10-01T02:04:00Z','check','complete','good','nothing has changed',0,NULL,74,NULL,NULL,240.0);
INSERT INTO "night" VALUES(2,1,'2026-10-02','2026-10-02T02:00:00Z','2026-10-02T02:04:00Z','check','complete','changed','nothing has changed',1,NULL,74,NULL,NULL,240.0);
CREATE TABLE night_estimate (
	entry_id INTEGER NOT NULL, 
	names TEXT NOT NULL, 
	numbers BLOB NOT NULL, 
	PRIMARY KEY (entry_id), 
	FOREIGN KEY(entry_id) REFERENCES entry (id)
);
INSERT INTO "night_estimate" VALUES(1,'["EX0C", "EA0B", "EXt", "EZf3"]',X'7801636040061FECA13C0708CDE1507A207DE19D49FBEC3F59553CD166BB626F776357679DEF077BCFAFBA7D250A07EC63AA96A47C68BB6BCF27F6D87EB9C119FB0FF57F5CAE7B5ED83F2756E5D38195CFF73786ED71E954B8BABFF583788051FF277B0046D02C01');
INSERT INTO "night_estimate" VALUES(2,'["EX0C", "EA0B", "EXt", "EZf3"]',X'7801636040010E109E00949670F89D54C1B1DA6791BDA4D826D3C66357ED2DF2F92CCC0D851C6EECB0E4F3B2586D9F6CFED95423E4C07EC1F2B82F6D655FED0D120B6314AEACDFEFEA79B538FAC7F7FD8C57A7D89EF77F69BF3564D789D2AA77F600AD6025F3');
CREATE TABLE night_parameter (
	machine_id INTEGER NOT NULL, 
	name VARCHAR(80) NOT NULL, 
	entry_id INTEGER NOT NULL, 
	start_utc VARCHAR(32) NOT NULL, 
	value FLOAT NOT NULL, 
	std FLOAT NOT NULL, 
	unit VARCHAR(20) NOT NULL, 
	PRIMARY KEY (machine_id, name, entry_id), 
	FOREIGN KEY(machine_id) REFERENCES machine (id), 
	FOREIGN KEY(entry_id) REFERENCES entry (id)
);
INSERT INTO "night_parameter" VALUES(1,'EX0C',1,'2026-10-01T02:00:00Z',0.001,0.0002,'mm');
INSERT INTO "night_parameter" VALUES(1,'EX0C',2,'2026-10-02T02:00:00Z',0.002,0.0002,'mm');
CREATE TABLE night_readings (
	entry_id INTEGER NOT NULL, 
	rows INTEGER NOT NULL, 
	sha256 VARCHAR(64) NOT NULL, 
	csv BLOB NOT NULL, 
	PRIMARY KEY (entry_id), 
	FOREIGN KEY(entry_id) REFERENCES entry (id)
);
INSERT INTO "night_readings" VALUES(1,1,'01713675ac8a640a57b5f88da6352d68dc63e6861e6f58a98da48f1aed33dc23',X'789C2BC92F4DCEE032E402000D880269');
INSERT INTO "night_readings" VALUES(2,1,'77f5a9ab3007ebf82b73dc4da549e48b73a343bb4f5845fd11e5e063758f66f0',X'789C2BC92F4DCEE032E202000D8A026A');
CREATE TABLE night_record (
	entry_id INTEGER NOT NULL, 
	json TEXT NOT NULL, 
	PRIMARY KEY (entry_id), 
	FOREIGN KEY(entry_id) REFERENCES entry (id)
);
INSERT INTO "night_record" VALUES(1,'{"alarms":[],"cell":"/cells/m","duration_s":240.0,"end_utc":"2026-10-01T02:04:00Z","format":"tango-night/1","headline":"nothing has changed","kind":"check","machine":"M","night":"2026-10-01","parameters":{"EX0C":{"std":0.0002,"unit":"mm","value":0.001}},"start_utc":"2026-10-01T02:00:00Z","status":"complete","touches":74,"verdict":"good"}');
INSERT INTO "night_record" VALUES(2,'{"alarms":[{"cause":"step","id":"2026-10-02-1"}],"cell":"/cells/m","duration_s":240.0,"end_utc":"2026-10-02T02:04:00Z","format":"tango-night/1","headline":"nothing has changed","kind":"check","machine":"M","night":"2026-10-02","parameters":{"EX0C":{"std":0.0002,"unit":"mm","value":0.002}},"start_utc":"2026-10-02T02:00:00Z","status":"complete","touches":74,"verdict":"changed"}');
CREATE INDEX ix_night_machine_start ON night (machine_id, start_utc);
CREATE INDEX ix_night_start ON night (start_utc);
CREATE INDEX ix_decision_machine ON decision (machine_id, utc);
CREATE TRIGGER entry_no_update BEFORE UPDATE ON entry BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER entry_no_delete BEFORE DELETE ON entry BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER night_no_update BEFORE UPDATE ON night BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER night_no_delete BEFORE DELETE ON night BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER night_record_no_update BEFORE UPDATE ON night_record BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER night_record_no_delete BEFORE DELETE ON night_record BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER night_parameter_no_update BEFORE UPDATE ON night_parameter BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER night_parameter_no_delete BEFORE DELETE ON night_parameter BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER night_readings_no_update BEFORE UPDATE ON night_readings BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER night_readings_no_delete BEFORE DELETE ON night_readings BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER night_estimate_no_update BEFORE UPDATE ON night_estimate BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER night_estimate_no_delete BEFORE DELETE ON night_estimate BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER decision_no_update BEFORE UPDATE ON decision BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER decision_no_delete BEFORE DELETE ON decision BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
COMMIT;
