package colonnade.environment

import chisel3._
import colonnade.config.{AttributeLayout, ColonnadeConfig}

/** Ports of [[AttributeConcentrator]]. */
final class AttributeConcentratorIO(config: ColonnadeConfig, requesters: Int, tagBits: Int) extends Bundle {
  private val layout = AttributeLayout.of(config)

  val ports  = Vec(requesters, Flipped(new AttributePort(layout, tagBits)))
  val served = new AttributePort(layout, AttributeArbiter.tagBits(requesters, tagBits))
}

/** Makes one port of several: an [[AttributeArbiter]] for each channel. */
final class AttributeConcentrator(config: ColonnadeConfig, requesters: Int, tagBits: Int) extends Module {
  val io = IO(new AttributeConcentratorIO(config, requesters, tagBits))

  join(_.albedo)
  join(_.normals)
  join(_.cells)
  join(_.planes)

  private def join[Q <: Data, A <: Data](channel: AttributePort => AttributeChannel[Q, A]): Unit = {
    val served  = channel(io.served)
    val arbiter = Module(
      new AttributeArbiter(
        chiselTypeOf(served.question.bits.content),
        chiselTypeOf(served.answer.bits.content),
        requesters,
        tagBits
      )
    )
    arbiter.io.requesters.zip(io.ports).foreach { case (requester, port) => requester <> channel(port) }
    served <> arbiter.io.served
  }
}
