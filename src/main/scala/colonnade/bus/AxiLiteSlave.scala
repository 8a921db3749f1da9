package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.axi.{Axi, AxiLite, AxiLitePort}

/** One access to a register. */
final class RegisterRequest(addressBits: Int) extends Bundle {
  val address = UInt((addressBits - 2).W) // word address
  val isWrite = Bool()
  val data    = UInt(AxiLite.dataBits.W)

  /** All bytes of the word are written; a write of some bytes is an error. */
  val isWhole = Bool()
}

final class RegisterResponse extends Bundle {

  /** Of a read. */
  val data    = UInt(AxiLite.dataBits.W)
  val isError = Bool()
}

/** Accesses one after the other: a response follows each request, at any time, before the next one. */
final class RegisterAccess(addressBits: Int) extends Bundle {
  val request  = Decoupled(new RegisterRequest(addressBits))
  val response = Flipped(Valid(new RegisterResponse))
}

/** An AXI4-Lite slave: reads and writes become accesses, one at a time, reads and writes in turn when both wait.
  *
  * Address and data of a write may come in any order. No output depends combinationally on an input. An access takes
  * four cycles from its last channel to its answer, if the registers answer in the next cycle.
  */
final class AxiLiteSlave(addressBits: Int) extends Module {
  val axi    = IO(Flipped(new AxiLitePort(addressBits)))
  val access = IO(new RegisterAccess(addressBits))

  private object State extends ChiselEnum {
    val idle, waiting, responding = Value
  }
  private val state    = RegInit(State.idle)
  private val isWrite  = RegInit(false.B)
  private val response = Reg(new RegisterResponse)

  private val aw       = Queue(axi.aw, 1)
  private val w        = Queue(axi.w, 1)
  private val ar       = Queue(axi.ar, 1)
  private val canWrite = aw.valid && w.valid
  private val writes   = canWrite && !(ar.valid && isWrite)

  access.request.valid        := state === State.idle && (canWrite || ar.valid)
  access.request.bits.isWrite := writes
  access.request.bits.address := Mux(writes, aw.bits.addr, ar.bits.addr) >> 2
  access.request.bits.data    := w.bits.data
  access.request.bits.isWhole := w.bits.strb.andR

  aw.ready := access.request.fire && writes
  w.ready  := aw.ready
  ar.ready := access.request.fire && !writes

  axi.b.valid     := state === State.responding && isWrite
  axi.r.valid     := state === State.responding && !isWrite
  axi.b.bits.resp := Mux(response.isError, Axi.slaveError, Axi.okay)
  axi.r.bits.resp := axi.b.bits.resp
  axi.r.bits.data := response.data

  switch(state) {
    is(State.idle) {
      when(access.request.fire) {
        state   := State.waiting
        isWrite := writes
      }
    }
    is(State.waiting) {
      when(access.response.valid) {
        state    := State.responding
        response := access.response.bits
      }
    }
    is(State.responding) { when(axi.b.fire || axi.r.fire) { state := State.idle } }
  }
}
