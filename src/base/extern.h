/* For C++: what an installed header declares has C's names. Between these two stand no #include and nothing that only
 * C knows. */
#ifndef RX_BASE_EXTERN_H
#define RX_BASE_EXTERN_H

#ifdef __cplusplus
#define RX_BEGIN_DECLS extern "C" {
#define RX_END_DECLS }
#else
#define RX_BEGIN_DECLS
#define RX_END_DECLS
#endif

#endif
