/* The declarations of Ipopt 3.14, in short and without the older names, which it still has but deprecates. */

#include <stdbool.h>

typedef double ipnumber;
typedef int ipindex;
typedef void *UserDataPtr;
typedef struct IpoptProblemInfo *IpoptProblem;

enum ApplicationReturnStatus { Solve_Succeeded = 0, User_Requested_Stop = 5, Maximum_WallTime_Exceeded = -5 };

typedef bool (*Eval_F_CB)(ipindex, ipnumber *, bool, ipnumber *, UserDataPtr);
typedef bool (*Eval_Grad_F_CB)(ipindex, ipnumber *, bool, ipnumber *, UserDataPtr);
typedef bool (*Eval_G_CB)(ipindex, ipnumber *, bool, ipindex, ipnumber *, UserDataPtr);
typedef bool (*Eval_Jac_G_CB)(ipindex, ipnumber *, bool, ipindex, ipindex, ipindex *, ipindex *, ipnumber *,
                              UserDataPtr);
typedef bool (*Eval_H_CB)(ipindex, ipnumber *, bool, ipnumber, ipindex, ipnumber *, bool, ipindex, ipindex *, ipindex *,
                          ipnumber *, UserDataPtr);
typedef bool (*Intermediate_CB)(ipindex, ipindex, ipnumber, ipnumber, ipnumber, ipnumber, ipnumber, ipnumber, ipnumber,
                                ipnumber, ipindex, UserDataPtr);

IpoptProblem CreateIpoptProblem(ipindex, ipnumber *, ipnumber *, ipindex, ipnumber *, ipnumber *, ipindex, ipindex,
                                ipindex, Eval_F_CB, Eval_G_CB, Eval_Grad_F_CB, Eval_Jac_G_CB, Eval_H_CB);
void FreeIpoptProblem(IpoptProblem);
bool AddIpoptStrOption(IpoptProblem, char *, char *);
bool AddIpoptNumOption(IpoptProblem, char *, ipnumber);
bool AddIpoptIntOption(IpoptProblem, char *, ipindex);
bool SetIntermediateCallback(IpoptProblem, Intermediate_CB);
bool GetIpoptCurrentIterate(IpoptProblem, bool, ipindex, ipnumber *, ipnumber *, ipnumber *, ipindex, ipnumber *,
                            ipnumber *);
enum ApplicationReturnStatus IpoptSolve(IpoptProblem, ipnumber *, ipnumber *, ipnumber *, ipnumber *, ipnumber *,
                                        ipnumber *, UserDataPtr);
