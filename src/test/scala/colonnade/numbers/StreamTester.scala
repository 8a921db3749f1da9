package colonnade.numbers

import chisel3._
import chisel3.util.DecoupledIO
import chiseltest._

import scala.collection.mutable
import scala.util.Random

/** Drives a unit with one input and one output stream, with random stalls on both. Checks the protocol: an offered
  * result does not change until it is taken.
  */
object StreamTester {

  /** @param stalls probability of a stall in a cycle, for each stream
    * @param limit  cycles without a transfer after which the test fails
    * @return the results in order
    */
  def exchange[I <: Data, O <: Data, X](clock: Clock, in: DecoupledIO[I], out: DecoupledIO[O], inputs: Seq[X])(
      poke: (I, X) => Unit,
      peek: O => BigInt
  )(random: Random, stalls: Double, limit: Int = 200): Seq[BigInt] = {
    val results  = mutable.ArrayBuffer.empty[BigInt]
    var next     = 0
    var offering = false
    var pending  = Option.empty[BigInt]
    var idle     = 0
    while (results.size < inputs.size) {
      if (!offering && next < inputs.size && random.nextDouble() >= stalls) {
        offering = true
        poke(in.bits, inputs(next))
      }
      in.valid.poke(offering)
      val accepts = random.nextDouble() >= stalls
      out.ready.poke(accepts)

      idle += 1
      val valid = out.valid.peekBoolean()
      val value = Option.when(valid)(peek(out.bits))
      require(pending.isEmpty || pending == value, s"the result ${pending.get} changed to $value before it was taken")
      pending = value
      if (valid && accepts) {
        results += value.get
        pending = None
        idle = 0
      }
      if (offering && in.ready.peekBoolean()) {
        next += 1
        offering = false
        idle = 0
      }
      require(idle < limit, s"no transfer for $limit cycles after ${results.size} results")
      clock.step()
    }
    in.valid.poke(false)
    results.toSeq
  }
}
