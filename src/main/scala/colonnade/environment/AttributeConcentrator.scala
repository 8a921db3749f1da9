package colonnade.environment

import chisel3._
import colonnade.config.{AttributeLayout, ColonnadeConfig}

final class AttributeConcentratorIO(config: ColonnadeConfig, requesters: Int, tagBits: Int) extends Bundle {
  private val layout = AttributeLayout.of(config)

  val ports  = Vec(requesters, Flipped(new AttributePort(layout, tagBits)))
  val joined = new AttributePort(layout, AttributeArbiter.tagBits(requesters, tagBits))
}

/** Joins several ports into one, with an [[AttributeArbiter]] for each channel. Of a column's ports the last one goes first,
  * the pipeline of directly seen pixels: it asks in every fourth cycle at most, and all pixels wait for it.
  */
final class AttributeConcentrator(config: ColonnadeConfig, requesters: Int, tagBits: Int, ofColumn: Boolean)
    extends Module {
  val io = IO(new AttributeConcentratorIO(config, requesters, tagBits))

  join(_.albedo)
  join(_.normals)
  join(_.cells)
  join(_.planes)

  private def join[Q <: Data, R <: Data](channel: AttributePort => AttributeChannel[Q, R]): Unit = {
    val joined  = channel(io.joined)
    val arbiter = Module(
      new AttributeArbiter(
        chiselTypeOf(joined.req.bits.content),
        chiselTypeOf(joined.resp.bits.content),
        requesters,
        tagBits,
        lastFirst = ofColumn
      )
    )
    arbiter.io.requesters.zip(io.ports).foreach { case (requester, port) => requester <> channel(port) }
    joined <> arbiter.io.joined
  }
}
