package colonnade.unit

import chiseltest._
import colonnade.TestParts._
import colonnade.{Model, OneSimulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

/** Leaves of any bits give the model's faces, in their order, however leaves come and faces are taken. */
class LeafDecoderSpec extends AnyFlatSpec with OneSimulation with Matchers {
  behavior of "LeafDecoder"

  /** More contexts than the queue has places. */
  private val config = TestConfigs.tiny.copy(units = TestConfigs.tiny.units.copy(pathContexts = 24))

  inOneSimulation(new LeafDecoder(config))(
    "find the attributes of hits at full rate" -> findAttributes(1, 1),
    "as leaves come"                           -> findAttributes(5, 1),
    "as the shader is ready"                   -> findAttributes(1, 9)
  )

  /** A leaf comes in one of `few` cycles, a face is taken in one of `fewTaken`. */
  private def findAttributes(few: Int, fewTaken: Int)(dut: LeafDecoder): Unit = {
    val random = new Random(few + fewTaken)
    val leaves = Seq.fill(150) {
      val record = Seq.fill(8)(BigInt(32, random))
      val isPair = (record.last >> 30) != 1
      BigInt(if (isPair) random.nextInt(2) else 0) +: record
    }
    val faces                  = Model.leaves(config, leaves, "leafface")
    val held                   = mutable.Queue.empty[(Int, Seq[BigInt])] // contexts and faces of leaves that wait
    val free                   = mutable.Queue.from(0 until 1 << dut.io.leaf.bits.context.getWidth)
    var (next, taken, cycle)   = (0, 0, 0)
    var (mayEnter, mayBeTaken) = (false, Option.empty[Int])
    dut.clock.setTimeout(0)
    while (taken < leaves.size) {
      cycle should be < 40 * leaves.size
      val enters = mayEnter && next < leaves.size && free.nonEmpty && random.nextInt(few) == 0
      dut.io.leaf.valid.poke(enters)
      if (enters) {
        val context = free.dequeue()
        dut.io.leaf.bits.context.poke(context)
        dut.io.leaf.bits.isSecond.poke(leaves(next).head != 0)
        dut.io.leaf.bits.record.poke(leaves(next).tail.reverse.reduceLeft((high, low) => (high << 32) | low))
        held.enqueue(context -> faces(next))
        next += 1
      }
      val accepts = random.nextInt(fewTaken) == 0
      dut.io.mayTakeNext.poke(accepts)
      dut.io.face.valid.expect(mayBeTaken.nonEmpty)
      for (context <- mayBeTaken) {
        val (of, expected) = held.dequeue()
        context shouldBe of
        dut.io.face.bits.context.expect(of)
        val face    = dut.io.face.bits
        val vectors = face.normals :+ face.geometricNormal
        face.material.expect(expected.head)
        for ((component, value) <- vectors.flatMap(_.axes).zip(expected.tail))
          component.raw.peek().litValue shouldBe value
        free.enqueue(of)
        taken += 1
      }
      mayEnter = dut.io.readyNext.peekBoolean()
      mayBeTaken = Option.when(dut.io.grantNext.valid.peekBoolean())(dut.io.grantNext.bits.peekInt().toInt)
      if (!accepts) mayBeTaken shouldBe empty
      dut.clock.step()
      cycle += 1
    }
    if (few == 1 && fewTaken == 1) cycle should be < 3 * leaves.size + 40
  }
}
