check_PROGRAMS += tests/unit/train/test_feed
tests_unit_train_test_feed_SOURCES = tests/unit/train/test_feed.c
tests_unit_train_test_feed_LDADD = librextract-train.la $(LDADD)
