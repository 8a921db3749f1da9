package colonnade.unit

import chiseltest._
import colonnade.TestParts._
import colonnade.{Model, OneSimulation, RandomPorts, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

/** Faces in the world equal the model's, in their order, however they come and are accepted. */
class WorldFacesSpec extends AnyFlatSpec with OneSimulation with Matchers {
  behavior of "WorldFaces"

  private val config = TestConfigs.withInstances(TestConfigs.tiny, 2)

  inOneSimulation(new WorldFaces(config))(
    "transform faces"        -> transform(few = 1),
    "as the shader is ready" -> transform(few = 7)
  )

  /** A face may leave in one of `few` cycles. */
  private def transform(few: Int)(dut: WorldFaces): Unit = {
    val random               = new Random(few)
    val io                   = dut.io
    val waiting              = mutable.Queue.empty[(BigInt, Seq[BigInt])]
    var (done, cycle)        = (0, 0)
    var (mayCome, isLeaving) = (false, false)
    val transforms           = io.instances.map { each =>
      RandomPorts.randomise(each.normal, random) ++ RandomPorts.randomise(each.materialBase, random)
    }
    dut.clock.setTimeout(0)
    while (done < 60) {
      cycle should be < 60 * 200
      val comes = mayCome && (few == 1 || random.nextInt(3) == 0)
      io.objectFace.valid.poke(comes)
      val normals = RandomPorts.randomise(io.objectFace.bits.normals, random) ++
        RandomPorts.randomise(io.objectFace.bits.geometricNormal, random)
      val material = RandomPorts.randomise(io.objectFace.bits.material, random)
      val context  = RandomPorts.randomise(io.objectFace.bits.context, random).head
      if (comes) {
        val number = random.nextInt(io.instances.size)
        io.objectFace.bits.instance.get.poke(number)
        val request = normals ++ material ++ transforms(number)
        val inWorld = Model.answers(config, Seq(request), "instanceface").head
        waiting.enqueue(context -> inWorld)
      }
      val accepts = random.nextInt(few) == 0
      io.mayTakeNext.poke(accepts)
      io.face.valid.expect(isLeaving)
      if (isLeaving) {
        val (of, expected) = waiting.dequeue()
        io.face.bits.context.expect(of)
        val found = RandomPorts.peek(io.face.bits.normals) ++ RandomPorts.peek(io.face.bits.geometricNormal)
        found :+ io.face.bits.material.peekInt() shouldBe expected
        done += 1
      }
      mayCome = io.mayComeNext.peekBoolean()
      isLeaving = io.grantNext.valid.peekBoolean()
      if (isLeaving) {
        accepts shouldBe true
        io.grantNext.bits.expect(waiting.head._1)
      }
      dut.clock.step()
      cycle += 1
    }
    if (few == 1) cycle should be <= 4 * 60 + 6
  }
}
