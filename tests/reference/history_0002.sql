BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0002');
CREATE TABLE compensation (
	entry_id INTEGER NOT NULL, 
	machine_id INTEGER NOT NULL, 
	number INTEGER NOT NULL, 
	target VARCHAR(40) NOT NULL, 
	event VARCHAR(20) NOT NULL, 
	text TEXT NOT NULL, 
	before_um FLOAT, 
	promised_um FLOAT, 
	measured_um FLOAT, 
	line TEXT NOT NULL, 
	line_sha256 VARCHAR(64) NOT NULL, 
	utc VARCHAR(32) NOT NULL, 
	PRIMARY KEY (entry_id), 
	CONSTRAINT uq_compensation_machine_id UNIQUE (machine_id, line_sha256), 
	FOREIGN KEY(entry_id) REFERENCES entry (id), 
	FOREIGN KEY(machine_id) REFERENCES machine (id)
);
INSERT INTO "compensation" VALUES(4,1,1,'siemens','proposed','',30.0,2.0,NULL,'{"compensation":1,"event":"proposed","promise":{"rms_after_um":{"value":2.0},"rms_before_um":{"value":30.0}},"target":"siemens","utc":"2026-10-03T09:00:00Z"}','2c4503f0c47654111dd26d0052c03eb1ee86866018434595fc1814e2ac7686b7','2026-10-03T09:00:00Z');
INSERT INTO "compensation" VALUES(5,1,1,'siemens','written','',NULL,NULL,NULL,'{"compensation":1,"event":"written","target":"siemens","utc":"2026-10-03T10:00:00Z"}','812f7e49cceaefb239ea89c48751a1139c4b052e19276c1faa433485b92be5a2','2026-10-03T10:00:00Z');
INSERT INTO "compensation" VALUES(6,1,1,'siemens','rolled back','a sign is wrong',NULL,NULL,58.0,'{"compensation":1,"event":"rolled back","measured_um":58.0,"target":"siemens","text":"a sign is wrong","utc":"2026-10-03T11:00:00Z"}','4ddb28f9174a31f28363c19696f6c69960259870ea55a51ecb1bd98d0c84a137','2026-10-03T11:00:00Z');
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
INSERT INTO "entry" VALUES(1,1,1,'night','2026-10-01T02:04:00Z','8f0d43b5a4f2e5b6ff693dcae48897badfadb5520054908d597990606bbd9d69','0000000000000000000000000000000000000000000000000000000000000000','1797bc37e88a488ee11f053bf6d47e817746e1e24ee83b9948b32e0c172171ef');
INSERT INTO "entry" VALUES(2,1,2,'night','2026-10-02T02:04:00Z','adfd3b12d3e4134d749644141b34515b5aa78f4972aaab14f0a847a7acb0b19d','1797bc37e88a488ee11f053bf6d47e817746e1e24ee83b9948b32e0c172171ef','7998e4537b9691292fa0fa08e4fc72e25cb6ed34192eb0962c5fd44d60f38225');
INSERT INTO "entry" VALUES(3,1,3,'decision','2026-10-02T08:00:00Z','6ac250fdfa983714f4d03c9b41240c504c5c35cc8ee057f7e0d810ddf566e1a4','7998e4537b9691292fa0fa08e4fc72e25cb6ed34192eb0962c5fd44d60f38225','0f7d473bff218e7451122609777175dd9cfca7925c41dda5ceddb0b4e218d9bb');
INSERT INTO "entry" VALUES(4,1,4,'compensation','2026-10-03T09:00:00Z','42f4779d21553792f2639d433f725417db6dfed7a82f41192e87f40226010c14','0f7d473bff218e7451122609777175dd9cfca7925c41dda5ceddb0b4e218d9bb','6d0415623675e122c56eb830102dc2b3e76674f4bc100b4b34457e3fdc1d9734');
INSERT INTO "entry" VALUES(5,1,5,'compensation','2026-10-03T10:00:00Z','4d0370cadaab689e4e540615bd2d49bf50f3d474754282e5c21996b49f865a72','6d0415623675e122c56eb830102dc2b3e76674f4bc100b4b34457e3fdc1d9734','998810eb528e9bf8713e8d75d34cf77247c70d46bb61e9a216e8223963c7af5e');
INSERT INTO "entry" VALUES(6,1,6,'compensation','2026-10-03T11:00:00Z','358674b964e2792e4c8e194d2e6798c836241d49a2a2ba9a6a51b463bf4e596a','998810eb528e9bf8713e8d75d34cf77247c70d46bb61e9a216e8223963c7af5e','25eee6c8899d62ee595a165b0bddfcdecc9c8effa01d2312e0e44999e9ffc2dc');
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
INSERT INTO "night" VALUES(2,1,'2026-10-02','2026-10-02T02:00:00Z','2026-10-02T02:04:00Z','check','complete','good','nothing has changed',1,NULL,74,NULL,NULL,240.0);
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
INSERT INTO "night_record" VALUES(2,'{"alarms":[{"cause":"step","id":"2026-10-02-1"}],"cell":"/cells/m","duration_s":240.0,"end_utc":"2026-10-02T02:04:00Z","format":"tango-night/1","headline":"nothing has changed","kind":"check","machine":"M","night":"2026-10-02","parameters":{"EX0C":{"std":0.0002,"unit":"mm","value":0.002}},"start_utc":"2026-10-02T02:00:00Z","status":"complete","touches":74,"verdict":"good"}');
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
CREATE INDEX ix_compensation_machine ON compensation (machine_id, utc);
CREATE TRIGGER compensation_no_update BEFORE UPDATE ON compensation BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
CREATE TRIGGER compensation_no_delete BEFORE DELETE ON compensation BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END;
COMMIT;
